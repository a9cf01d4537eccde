#include <fmt/format.h>

#include "backend/gltf/accessor.h"
#include "backend/gltf/links.h"
#include "backend/util/checked.h"

namespace octrace::gltf {
namespace {

struct Region {
  int view = -1;
  std::uint64_t offset = 0, count = 0, stride = 0, element = 0, component = 0;
};

// That `region` lies in its buffer view, aligned to its components. check_structure bounds offsets
// by 2^53, counts by 2^31 and strides by 252, so the sums and products here cannot wrap; they are
// checked all the same.
void check_region(const tinygltf::Model& model, const Region& region, const std::string& pointer,
                  Issues& issues) {
  const auto& view = model.bufferViews[static_cast<std::size_t>(region.view)];
  if (region.offset % region.component != 0) {
    issues.invalid("ACCESSOR_OFFSET_ALIGNMENT", pointer + "/byteOffset",
                   fmt::format("needs a multiple of {}, has {}", region.component, region.offset));
    return;
  }
  if ((region.offset + view.byteOffset) % region.component != 0) {
    issues.invalid("ACCESSOR_TOTAL_OFFSET_ALIGNMENT", pointer,
                   fmt::format("needs a multiple of {}, has {} in the buffer", region.component,
                               region.offset + view.byteOffset));
    return;
  }
  const auto strides = util::checked_mul(region.stride, region.count - 1);
  const auto length = strides ? util::checked_add(*strides, region.element) : std::nullopt;
  const auto end = length ? util::checked_add(*length, region.offset) : std::nullopt;
  if (!end || *end > view.byteLength) {
    issues.invalid(
        "ACCESSOR_TOO_LONG", pointer,
        fmt::format("needs {} bytes from {}, buffer view {} has {}", length.value_or(UINT64_MAX),
                    region.offset, region.view, view.byteLength));
  }
}

void check_sparse(const tinygltf::Model& model, const tinygltf::Accessor& accessor,
                  const std::string& pointer, Issues& issues) {
  const auto& sparse = accessor.sparse;
  const auto check = [&](const char* part, int view, int offset, const ElementLayout& layout) {
    const std::string place = fmt::format("{}/sparse/{}", pointer, part);
    if (model.bufferViews[static_cast<std::size_t>(view)].byteStride != 0) {
      issues.invalid("BUFFER_VIEW_INVALID_BYTE_STRIDE", place + "/bufferView",
                     fmt::format("buffer view {} has a stride", view));
      return;
    }
    check_region(
        model,
        {view, static_cast<std::uint64_t>(offset), static_cast<std::uint64_t>(sparse.count),
         layout.bytes, layout.bytes, layout.component_bytes},
        place, issues);
  };
  check("indices", sparse.indices.bufferView, sparse.indices.byteOffset,
        element_layout(TINYGLTF_TYPE_SCALAR, sparse.indices.componentType));
  check("values", sparse.values.bufferView, sparse.values.byteOffset, element_layout(accessor));
}

}  // namespace

void check_accessor_links(const tinygltf::Model& model, const util::Limits& limits,
                          Issues& issues) {
  // Without a buffer behind it an accessor may claim any count, and many may share one view, so
  // what they need together is bounded.
  std::uint64_t total = 0;
  for (std::size_t i = 0; i < model.accessors.size() && !issues.failed(); ++i) {
    const auto& accessor = model.accessors[i];
    const std::string pointer = fmt::format("/accessors/{}", i);
    const ElementLayout layout = element_layout(accessor);
    if (accessor.bufferView >= 0) {
      const auto& view = model.bufferViews[static_cast<std::size_t>(accessor.bufferView)];
      if (view.byteStride != 0 && view.byteStride < layout.bytes) {
        issues.invalid("ACCESSOR_SMALL_BYTESTRIDE", pointer,
                       fmt::format("needs {} bytes an element, buffer view {} has a stride of {}",
                                   layout.bytes, accessor.bufferView, view.byteStride));
        return;
      }
      const std::size_t stride = view.byteStride != 0 ? view.byteStride : layout.bytes;
      check_region(model,
                   {accessor.bufferView, accessor.byteOffset, accessor.count, stride, layout.bytes,
                    layout.component_bytes},
                   pointer, issues);
    }
    if (accessor.sparse.isSparse) check_sparse(model, accessor, pointer, issues);
    const auto decoded = util::checked_mul(accessor.count, layout.components * sizeof(float));
    const auto sum = decoded ? util::checked_add(total, *decoded) : std::nullopt;
    if (!sum || *sum > limits.max_scene_bytes) {
      issues.fail(util::Exit::limit, "LIMIT", pointer,
                  fmt::format("the accessors up to this one need {} bytes, --max-scene-bytes "
                              "allows {}",
                              sum.value_or(UINT64_MAX), limits.max_scene_bytes));
      return;
    }
    total = *sum;
  }
}

}  // namespace octrace::gltf
