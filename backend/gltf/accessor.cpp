#include "backend/gltf/accessor.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

#include "backend/gltf/document.h"

namespace octrace::gltf {
namespace {

static_assert(std::endian::native == std::endian::little, "glTF's buffers are little-endian");

const std::uint8_t* view_data(const tinygltf::Model& model, int view, std::size_t offset) {
  const auto& buffer_view = model.bufferViews[static_cast<std::size_t>(view)];
  const auto& buffer = model.buffers[static_cast<std::size_t>(buffer_view.buffer)];
  return buffer.data.data() + buffer_view.byteOffset + offset;
}

// glTF 2.0, 3.6.2.2: signed types divide by their largest value and clamp.
template <class T>
float to_float(T value, bool normalized) {
  if constexpr (std::is_floating_point_v<T>) {
    return value;
  } else {
    if (!normalized) return static_cast<float>(value);
    const float scaled =
        static_cast<float>(value) / static_cast<float>(std::numeric_limits<T>::max());
    return std::max(scaled, -1.0f);
  }
}

template <class T, class Out, class Convert>
void gather(const std::uint8_t* data, std::size_t stride, const ElementLayout& layout,
            std::size_t count, Out* out, Convert convert) {
  for (std::size_t i = 0; i < count; ++i, data += stride) {
    for (std::size_t c = 0; c < layout.components; ++c) {
      T value;
      std::memcpy(&value,
                  data + c / layout.rows * layout.column_bytes + c % layout.rows * sizeof(T),
                  sizeof(T));
      *out++ = convert(value);
    }
  }
}

// The integers' conversion to Out for each component type; `Out` is float or std::uint32_t.
template <class Out>
void gather_any(int component_type, bool normalized, const std::uint8_t* data, std::size_t stride,
                const ElementLayout& layout, std::size_t count, Out* out) {
  const auto convert = [normalized](auto value) {
    if constexpr (std::is_same_v<Out, float>) {
      return to_float(value, normalized);
    } else {
      return static_cast<Out>(value);
    }
  };
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return gather<std::int8_t>(data, stride, layout, count, out, convert);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return gather<std::uint8_t>(data, stride, layout, count, out, convert);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return gather<std::int16_t>(data, stride, layout, count, out, convert);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return gather<std::uint16_t>(data, stride, layout, count, out, convert);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return gather<std::uint32_t>(data, stride, layout, count, out, convert);
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      if constexpr (std::is_same_v<Out, float>) {
        if (stride == layout.components * sizeof(float)) {
          std::memcpy(out, data, count * stride);
          return;
        }
        return gather<float>(data, stride, layout, count, out, convert);
      }
      break;
    default:
      break;
  }
  assert(false && "component types are checked by load()");
}

template <class Out>
void read(const tinygltf::Model& model, int index, std::vector<Out>& out) {
  const auto& accessor = model.accessors[static_cast<std::size_t>(index)];
  const ElementLayout layout = element_layout(accessor);
  out.assign(accessor.count * layout.components, Out{});
  if (accessor.bufferView >= 0) {
    const auto& view = model.bufferViews[static_cast<std::size_t>(accessor.bufferView)];
    const std::size_t stride = view.byteStride != 0 ? view.byteStride : layout.bytes;
    gather_any(accessor.componentType, accessor.normalized,
               view_data(model, accessor.bufferView, accessor.byteOffset), stride, layout,
               accessor.count, out.data());
  }
  if (!accessor.sparse.isSparse) return;
  const auto& sparse = accessor.sparse;
  const auto count = static_cast<std::size_t>(sparse.count);
  std::vector<std::uint32_t> places;
  read_sparse_indices(model, index, places);
  std::vector<Out> values(count * layout.components);
  gather_any(accessor.componentType, accessor.normalized,
             view_data(model, sparse.values.bufferView,
                       static_cast<std::size_t>(sparse.values.byteOffset)),
             layout.bytes, layout, count, values.data());
  for (std::size_t i = 0; i < count; ++i) {
    std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(i * layout.components),
                layout.components,
                out.begin() + static_cast<std::ptrdiff_t>(places[i] * layout.components));
  }
}

// Calls fn(values) with the effective values, or with as many of them as may differ from zero: an
// accessor without a buffer view is zero but for its sparse values.
template <class Out, class Fn>
auto with_values(const tinygltf::Model& model, int index, Fn fn) {
  const auto& accessor = model.accessors[static_cast<std::size_t>(index)];
  std::vector<Out> values;
  if (accessor.bufferView >= 0) {
    read(model, index, values);
  } else if (accessor.sparse.isSparse) {
    const ElementLayout layout = element_layout(accessor);
    const auto count = static_cast<std::size_t>(accessor.sparse.count);
    values.resize(count * layout.components);
    gather_any(accessor.componentType, accessor.normalized,
               view_data(model, accessor.sparse.values.bufferView,
                         static_cast<std::size_t>(accessor.sparse.values.byteOffset)),
               layout.bytes, layout, count, values.data());
  }
  return fn(values);
}

}  // namespace

ElementLayout element_layout(int type, int component_type) {
  ElementLayout layout;
  layout.component_bytes = static_cast<std::size_t>(
      tinygltf::GetComponentSizeInBytes(static_cast<uint32_t>(component_type)));
  std::size_t columns = 1;
  switch (type) {
    case TINYGLTF_TYPE_VEC2:
      layout.rows = 2;
      break;
    case TINYGLTF_TYPE_VEC3:
      layout.rows = 3;
      break;
    case TINYGLTF_TYPE_VEC4:
      layout.rows = 4;
      break;
    case TINYGLTF_TYPE_MAT2:
      layout.rows = columns = 2;
      break;
    case TINYGLTF_TYPE_MAT3:
      layout.rows = columns = 3;
      break;
    case TINYGLTF_TYPE_MAT4:
      layout.rows = columns = 4;
      break;
    default:
      layout.rows = 1;
      break;
  }
  layout.components = layout.rows * columns;
  layout.column_bytes = layout.rows * layout.component_bytes;
  if (columns > 1) layout.column_bytes = (layout.column_bytes + 3) / 4 * 4;  // glTF 2.0, 3.6.2.4
  layout.bytes = layout.column_bytes * columns;
  return layout;
}

ElementLayout element_layout(const tinygltf::Accessor& accessor) {
  return element_layout(accessor.type, accessor.componentType);
}

std::string format_name(int type, int component_type, bool normalized) {
  const char* shape = "SCALAR";
  switch (type) {
    case TINYGLTF_TYPE_VEC2:
      shape = "VEC2";
      break;
    case TINYGLTF_TYPE_VEC3:
      shape = "VEC3";
      break;
    case TINYGLTF_TYPE_VEC4:
      shape = "VEC4";
      break;
    case TINYGLTF_TYPE_MAT2:
      shape = "MAT2";
      break;
    case TINYGLTF_TYPE_MAT3:
      shape = "MAT3";
      break;
    case TINYGLTF_TYPE_MAT4:
      shape = "MAT4";
      break;
    default:
      break;
  }
  const char* component = "FLOAT";
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      component = "BYTE";
      break;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      component = "UNSIGNED_BYTE";
      break;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      component = "SHORT";
      break;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      component = "UNSIGNED_SHORT";
      break;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      component = "UNSIGNED_INT";
      break;
    default:
      break;
  }
  return fmt::format("{} of {}{}", shape, normalized ? "normalised " : "", component);
}

void read_floats(const tinygltf::Model& model, int accessor, std::vector<float>& out) {
  read(model, accessor, out);
}

void read_uints(const tinygltf::Model& model, int accessor, std::vector<std::uint32_t>& out) {
  read(model, accessor, out);
}

void read_sparse_indices(const tinygltf::Model& model, int accessor,
                         std::vector<std::uint32_t>& out) {
  const auto& sparse = model.accessors[static_cast<std::size_t>(accessor)].sparse;
  const auto count = static_cast<std::size_t>(sparse.count);
  const ElementLayout layout = element_layout(TINYGLTF_TYPE_SCALAR, sparse.indices.componentType);
  out.resize(count);
  gather_any(sparse.indices.componentType, false,
             view_data(model, sparse.indices.bufferView,
                       static_cast<std::size_t>(sparse.indices.byteOffset)),
             layout.bytes, layout, count, out.data());
}

std::optional<std::size_t> first_not_finite(const tinygltf::Model& model, int accessor) {
  const std::size_t components =
      element_layout(model.accessors[static_cast<std::size_t>(accessor)]).components;
  return with_values<float>(model, accessor,
                            [&](const std::vector<float>& values) -> std::optional<std::size_t> {
                              for (std::size_t i = 0; i < values.size(); ++i) {
                                if (!std::isfinite(values[i])) return i / components;
                              }
                              return std::nullopt;
                            });
}

std::uint32_t largest_uint(const tinygltf::Model& model, int accessor) {
  return with_values<std::uint32_t>(model, accessor, [](const std::vector<std::uint32_t>& values) {
    return values.empty() ? 0 : *std::max_element(values.begin(), values.end());
  });
}

std::vector<float> Document::read_floats(int accessor) const {
  std::vector<float> out;
  gltf::read_floats(model, accessor, out);
  return out;
}

std::vector<std::uint32_t> Document::read_uints(int accessor) const {
  std::vector<std::uint32_t> out;
  gltf::read_uints(model, accessor, out);
  return out;
}

}  // namespace octrace::gltf
