// Buffers, buffer views and accessors.
#include <fmt/format.h>

#include <array>
#include <limits>

#include "backend/gltf/structure.h"

namespace octrace::gltf {
namespace {

// Sizes and offsets: JSON numbers are exact up to 2^53, and no file is larger.
constexpr std::int64_t kMaxBytes = std::int64_t{1} << 53;
// Counts are kept as int by much code behind this.
constexpr std::int64_t kMaxCount = std::numeric_limits<std::int32_t>::max();

constexpr std::array<std::int64_t, 6> kComponentTypes{5120, 5121, 5122, 5123, 5125, 5126};
constexpr std::array<std::int64_t, 3> kIndexTypes{5121, 5123, 5125};
constexpr std::array<std::string_view, 7> kTypes{"SCALAR", "VEC2", "VEC3", "VEC4",
                                                 "MAT2",   "MAT3", "MAT4"};
constexpr std::array<std::int64_t, 2> kTargets{34962, 34963};

std::size_t component_count(std::string_view type) {
  constexpr std::array<std::size_t, kTypes.size()> counts{1, 2, 3, 4, 4, 9, 16};
  for (std::size_t i = 0; i < kTypes.size(); ++i) {
    if (kTypes[i] == type) return counts[i];
  }
  return 0;
}

void check_sparse(const JsonRef& sparse, std::int64_t accessor_count, const Sizes& sizes) {
  if (!sparse) return;
  check_common(sparse);
  const JsonRef count = sparse.required("count");
  const auto elements = count.as_integer(1, kMaxCount);
  const JsonRef indices = sparse.required("indices").as_object();
  const JsonRef values = sparse.required("values").as_object();
  for (const JsonRef* part : {&indices, &values}) {
    if (!*part) continue;
    check_common(*part);
    (void)part->required("bufferView").as_index(sizes.buffer_views, "buffer view");
    // tinygltf keeps these two offsets as int.
    (void)part->member("byteOffset").as_integer(0, std::numeric_limits<std::int32_t>::max());
  }
  if (indices) (void)indices.required("componentType").as_one_of(kIndexTypes);
  if (elements && *elements > accessor_count) {
    count.invalid(
        "ACCESSOR_SPARSE_COUNT_OUT_OF_RANGE",
        fmt::format("overrides {} elements, the accessor has {}", *elements, accessor_count));
  }
}

}  // namespace

void check_buffers(const JsonRef& root, const Sizes& sizes) {
  each_object(root, "buffers", [&](const JsonRef& buffer) {
    check_common(buffer);
    (void)buffer.member("uri").as_string();
    (void)buffer.required("byteLength").as_integer(1, kMaxBytes);
  });
  each_object(root, "bufferViews", [&](const JsonRef& view) {
    check_common(view);
    const int index = view.required("buffer").as_index(sizes.buffers, "buffer");
    const JsonRef offset_ref = view.member("byteOffset");
    const JsonRef length_ref = view.required("byteLength");
    const auto offset = offset_ref ? offset_ref.as_integer(0, kMaxBytes) : 0;
    const auto length = length_ref.as_integer(1, kMaxBytes);
    (void)view.member("target").as_one_of(kTargets);
    const JsonRef stride_ref = view.member("byteStride");
    const auto stride = stride_ref.as_integer(4, 252);
    if (stride && *stride % 4 != 0) {
      stride_ref.invalid("VALUE_MULTIPLE_OF",
                         fmt::format("needs a multiple of 4, has {}", *stride));
    }
    if (index < 0 || !offset || !length || root.issues().failed()) return;
    const JsonRef buffers = root.member("buffers");
    const JsonRef buffer = buffers.element(static_cast<std::size_t>(index));
    const std::int64_t available = buffer.member("byteLength").as_integer(1, kMaxBytes).value_or(0);
    if (*offset + *length > available) {  // both at most 2^53
      (*offset >= available ? offset_ref : length_ref)
          .invalid("BUFFER_VIEW_TOO_LONG", fmt::format("needs {} bytes from {}, buffer {} has {}",
                                                       *length, *offset, index, available));
    } else if (stride && *stride > *length) {
      stride_ref.invalid("BUFFER_VIEW_TOO_BIG_BYTE_STRIDE",
                         fmt::format("the stride is {}, the view has {} bytes", *stride, *length));
    }
  });
}

void check_accessors(const JsonRef& root, const Sizes& sizes) {
  each_object(root, "accessors", [&](const JsonRef& accessor) {
    check_common(accessor);
    (void)accessor.member("bufferView").as_index(sizes.buffer_views, "buffer view");
    const JsonRef offset = accessor.member("byteOffset");
    (void)offset.as_integer(0, kMaxBytes);
    if (offset && !accessor.member("bufferView")) {
      offset.invalid("UNSATISFIED_DEPENDENCY", "needs bufferView beside byteOffset");
    }
    const auto component = accessor.required("componentType").as_one_of(kComponentTypes);
    const auto count = accessor.required("count").as_integer(1, kMaxCount);
    const auto type = accessor.required("type").as_one_of(kTypes);
    const JsonRef normalized = accessor.member("normalized");
    if (normalized.as_boolean().value_or(false) && component && *component > 5123) {
      normalized.invalid("ACCESSOR_NORMALIZED_INVALID",
                         fmt::format("only bytes and shorts can be normalised, the component type "
                                     "is {}",
                                     *component));
    }
    if (type) {
      for (const auto* key : {"min", "max"}) {
        const JsonRef bound = accessor.member(key);
        if (!bound) continue;
        constexpr double kLargest = std::numeric_limits<double>::max();
        (void)bound.as_numbers(component_count(*type), -kLargest, kLargest);
      }
    }
    const JsonRef sparse = accessor.member("sparse");
    if (count) check_sparse(sparse.as_object(), *count, sizes);
  });
}

}  // namespace octrace::gltf
