// EXT_meshopt_compression of buffer views and KHR_draco_mesh_compression of primitives. What the
// compressed bytes say is the decoders' business.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>

#include "backend/gltf/structure.h"

namespace octrace::gltf {
namespace {

constexpr std::int64_t kMaxBytes = std::int64_t{1} << 53;
constexpr std::int64_t kMaxCount = std::numeric_limits<std::int32_t>::max();
constexpr std::array<std::string_view, 3> kModes{"ATTRIBUTES", "TRIANGLES", "INDICES"};
constexpr std::array<std::string_view, 4> kFilters{"NONE", "OCTAHEDRAL", "QUATERNION",
                                                   "EXPONENTIAL"};
constexpr const char* kMeshopt = "EXT_meshopt_compression";

// A name that is not in the list is of a newer revision of the extension: unsupported, not broken.
template <std::size_t N>
std::string_view known_name(const JsonRef& ref, const std::array<std::string_view, N>& names,
                            std::string_view otherwise) {
  const auto name = ref.as_string();
  if (!name) return otherwise;
  if (std::find(names.begin(), names.end(), *name) != names.end()) return *name;
  if (!ref.issues().failed()) {
    ref.issues().fail(
        util::Exit::unsupported, "VALUE_NOT_IN_LIST", ref.pointer(),
        fmt::format("{} is not known; octrace has {}", quote(*name), fmt::join(names, ", ")));
  }
  return otherwise;
}

struct Layout {
  std::int64_t stride, count;
  std::string_view mode, filter;
};

// The list of conditions in the extension's text.
void check_layout(const JsonRef& json, const Layout& layout) {
  const JsonRef stride = json.member("byteStride");
  const auto needs = [&](const char* what) {
    stride.invalid(
        "MESHOPT_INVALID_BYTESTRIDE",
        fmt::format("{} of {} needs {}, has {}", layout.mode, layout.filter, what, layout.stride));
  };
  if (layout.mode == "ATTRIBUTES") {
    if (layout.stride % 4 != 0) needs("a multiple of 4");
    if (layout.filter == "OCTAHEDRAL" && layout.stride != 4 && layout.stride != 8) needs("4 or 8");
    if (layout.filter == "QUATERNION" && layout.stride != 8) needs("8");
    return;
  }
  if (layout.stride != 2 && layout.stride != 4) needs("2 or 4");
  if (layout.mode == "TRIANGLES" && layout.count % 3 != 0) {
    const JsonRef count = json.member("count");
    count.invalid("VALUE_MULTIPLE_OF",
                  fmt::format("triangles need a multiple of 3, has {}", layout.count));
  }
  if (layout.filter != "NONE") {
    const JsonRef filter = json.member("filter");
    filter.invalid("MESHOPT_INVALID_FILTER",
                   fmt::format("{} takes no filter, has {}", layout.mode, layout.filter));
  }
}

void check_source(const JsonRef& root, const JsonRef& json, const Sizes& sizes) {
  const int index = json.required("buffer").as_index(sizes.buffers, "buffer");
  const JsonRef offset_ref = json.member("byteOffset");
  const JsonRef length_ref = json.required("byteLength");
  const auto offset = offset_ref ? offset_ref.as_integer(0, kMaxBytes) : 0;
  const auto length = length_ref.as_integer(1, kMaxBytes);
  if (index < 0 || !offset || !length || root.issues().failed()) return;
  const JsonRef buffers = root.member("buffers");
  const JsonRef buffer = buffers.element(static_cast<std::size_t>(index));
  const std::int64_t available = buffer.member("byteLength").as_integer(1, kMaxBytes).value_or(0);
  if (*offset + *length > available) {  // both at most 2^53
    length_ref.invalid("BUFFER_VIEW_TOO_LONG",
                       fmt::format("needs {} bytes from {}, buffer {} has {}", *length, *offset,
                                   index, available));
  }
  const JsonRef extensions = buffer.member("extensions");
  const JsonRef fallback = extensions.member(kMeshopt);
  if (fallback.member("fallback").as_boolean().value_or(false)) {
    json.member("buffer").invalid(
        "MESHOPT_FALLBACK_BUFFER",
        fmt::format("buffer {} is a fallback, which holds no compressed data", index));
  }
}

void check_meshopt_view(const JsonRef& root, const JsonRef& view, const Sizes& sizes) {
  const JsonRef extensions = view.member("extensions");
  const JsonRef json = extensions.member(kMeshopt);
  if (!json) return;
  check_source(root, json, sizes);
  const auto stride = json.required("byteStride").as_integer(1, 256);
  const auto count = json.required("count").as_integer(1, kMaxCount);
  const auto mode = known_name(json.required("mode"), kModes, "");
  const auto filter = known_name(json.member("filter"), kFilters, "NONE");
  if (!stride || !count || root.issues().failed()) return;
  check_layout(json, {*stride, *count, mode, filter});
  const JsonRef view_length = view.member("byteLength");
  const auto length = view_length.as_integer(1, kMaxBytes);
  if (length && *length != *stride * *count) {
    view_length.invalid("MESHOPT_LENGTH_MISMATCH",
                        fmt::format("{} elements of {} bytes are {} bytes, the view has {}", *count,
                                    *stride, *stride * *count, *length));
  }
  const JsonRef view_stride = view.member("byteStride");
  const auto declared = view_stride.as_integer(4, 252);
  if (declared && *declared != *stride) {
    view_stride.invalid("MESHOPT_INVALID_BYTESTRIDE",
                        fmt::format("is {}, decoded elements have {}", *declared, *stride));
  }
}

// A fallback's bytes are never read, so nothing may refer to them but through compression.
void check_fallback(const JsonRef& root, const JsonRef& view) {
  const JsonRef own = view.member("extensions");
  if (own.member(kMeshopt)) return;
  const int index = view.member("buffer").as_index(std::numeric_limits<int>::max(), "buffer");
  if (index < 0) return;
  const JsonRef buffers = root.member("buffers");
  const JsonRef buffer = buffers.element(static_cast<std::size_t>(index));
  const JsonRef extensions = buffer.member("extensions");
  const JsonRef fallback = extensions.member(kMeshopt);
  if (!fallback.member("fallback").as_boolean().value_or(false)) return;
  view.member("buffer").invalid(
      "MESHOPT_FALLBACK_BUFFER",
      fmt::format("buffer {} is a fallback; only compressed views may name it", index));
}

void check_draco(const JsonRef& primitive, const Sizes& sizes) {
  const JsonRef extensions = primitive.member("extensions");
  const JsonRef json = extensions.member("KHR_draco_mesh_compression");
  if (!json) return;
  (void)json.required("bufferView").as_index(sizes.buffer_views, "buffer view");
  const JsonRef attributes = json.required("attributes").as_object();
  if (attributes && attributes.json().empty()) {
    attributes.invalid("EMPTY_ENTITY", "needs an attribute");
  }
  const JsonRef own = primitive.member("attributes");
  attributes.each_member([&](std::string_view name, const JsonRef& id) {
    (void)id.as_integer(0, std::numeric_limits<std::uint32_t>::max());
    if (!own.member(name)) {
      id.invalid("UNSATISFIED_DEPENDENCY",
                 fmt::format("the primitive itself has no {}", quote(name)));
    }
  });
  if (!primitive.member("indices")) {
    json.invalid("UNSATISFIED_DEPENDENCY", "the primitive itself has no indices");
  }
  const JsonRef mode = primitive.member("mode");
  const std::int64_t kind = mode ? mode.as_integer(0, 6).value_or(4) : 4;
  if (kind == 5) {
    primitive.issues().fail(util::Exit::unsupported, "DRACO_INVALID_MODE", mode.pointer(),
                            "octrace has no Draco of TRIANGLE_STRIP, only of TRIANGLES");
  } else if (kind != 4) {
    mode.invalid("DRACO_INVALID_MODE",
                 fmt::format("Draco holds TRIANGLES or TRIANGLE_STRIP, the mode is {}", kind));
  }
}

}  // namespace

void check_compression(const JsonRef& root, const Sizes& sizes) {
  if (root.issues().failed()) return;
  each_object(root, "bufferViews", [&](const JsonRef& view) {
    check_meshopt_view(root, view, sizes);
    check_fallback(root, view);
  });
  each_object(root, "meshes", [&](const JsonRef& mesh) {
    const JsonRef primitives = mesh.member("primitives");
    primitives.each_element(
        [&](std::size_t, const JsonRef& primitive) { check_draco(primitive, sizes); });
  });
}

}  // namespace octrace::gltf
