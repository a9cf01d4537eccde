#include "backend/gltf/draco.h"

#include <draco/mesh/mesh.h>
#include <fmt/format.h>

#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "backend/gltf/accessor.h"
#include "backend/gltf/draco_stream.h"

namespace octrace::gltf {
namespace {

using Bytes = std::vector<std::uint8_t>;

draco::DataType data_type(int component_type) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return draco::DT_INT8;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return draco::DT_UINT8;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return draco::DT_INT16;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return draco::DT_UINT16;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return draco::DT_UINT32;
    default:
      return draco::DT_FLOAT32;
  }
}

bool convert(const draco::PointAttribute& attribute, draco::AttributeValueIndex entry,
             int component_type, std::uint8_t* to) {
  const std::int8_t components = attribute.num_components();
  const auto as = [&](auto value) {
    using T = decltype(value);
    T values[16];
    if (!attribute.ConvertValue<T>(entry, components, values)) return false;
    std::memcpy(to, values, static_cast<std::size_t>(components) * sizeof(T));
    return true;
  };
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return as(std::int8_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return as(std::uint8_t{});
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return as(std::int16_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return as(std::uint16_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return as(std::uint32_t{});
    default:
      return as(float{});
  }
}

// The attribute's values by point, in the accessor's component type; nothing where a value does not
// fit it or is not there. `components` of the two are equal.
std::optional<Bytes> gather(const draco::Mesh& mesh, const draco::PointAttribute& attribute,
                            int component_type, const ElementLayout& layout) {
  Bytes out(std::size_t{mesh.num_points()} * layout.bytes);
  const bool same = attribute.data_type() == data_type(component_type);
  std::uint8_t* to = out.data();
  for (std::uint32_t p = 0; p < mesh.num_points(); ++p, to += layout.bytes) {
    const draco::AttributeValueIndex entry = attribute.mapped_index(draco::PointIndex(p));
    if (entry.value() >= attribute.size()) return std::nullopt;
    if (same) {
      std::memcpy(to, attribute.GetAddress(entry), layout.bytes);
    } else if (!convert(attribute, entry, component_type, to)) {
      return std::nullopt;
    }
  }
  return out;
}

template <class Index>
std::optional<Bytes> gather_faces(const draco::Mesh& mesh) {
  Bytes out(std::size_t{mesh.num_faces()} * 3 * sizeof(Index));
  std::uint8_t* to = out.data();
  for (std::uint32_t f = 0; f < mesh.num_faces(); ++f) {
    for (const draco::PointIndex& point : mesh.face(draco::FaceIndex(f))) {
      if (point.value() > std::numeric_limits<Index>::max()) return std::nullopt;
      const auto index = static_cast<Index>(point.value());
      std::memcpy(to, &index, sizeof index);
      to += sizeof index;
    }
  }
  return out;
}

std::optional<Bytes> gather_faces(const draco::Mesh& mesh, int component_type) {
  if (component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE) {
    return gather_faces<std::uint8_t>(mesh);
  }
  if (component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT) {
    return gather_faces<std::uint16_t>(mesh);
  }
  return gather_faces<std::uint32_t>(mesh);
}

class Decoder {
 public:
  Decoder(Structure& structure, const util::Limits& limits, Issues& issues)
      : model_(structure.model), limits_(limits), issues_(issues) {}

  // `primitives` all show the same view, which is decoded once.
  void decode(const std::vector<const DracoPrimitive*>& primitives) {
    known_.clear();
    faces_.clear();
    const DracoPrimitive& first = *primitives.front();
    const auto& view = model_.bufferViews[first.view];
    const auto& buffer = model_.buffers[static_cast<std::size_t>(view.buffer)].data;
    auto mesh =
        decode_draco_stream({buffer.data() + view.byteOffset, view.byteLength}, bounds_of(first));
    if (!mesh) {
      issues_.fail(mesh.error().exit, mesh.error().code, pointer(first),
                   std::move(mesh.error().message));
      return;
    }
    for (const DracoPrimitive* primitive : primitives) {
      place(*primitive, **mesh);
      if (issues_.failed()) return;
    }
  }

 private:
  static std::string pointer(const DracoPrimitive& draco) {
    return fmt::format("/meshes/{}/primitives/{}/extensions/KHR_draco_mesh_compression", draco.mesh,
                       draco.primitive);
  }
  tinygltf::Primitive& primitive(const DracoPrimitive& draco) {
    return model_.meshes[draco.mesh].primitives[draco.primitive];
  }
  tinygltf::Accessor& accessor(int i) { return model_.accessors[static_cast<std::size_t>(i)]; }

  DracoBounds bounds_of(const DracoPrimitive& draco) {
    const tinygltf::Primitive& shown = primitive(draco);
    DracoBounds bounds;
    bounds.max_points = accessor(shown.attributes.begin()->second).count;
    bounds.max_faces = accessor(shown.indices).count / 3;
    bounds.max_bytes = limits_.max_scene_bytes - total_;
    return bounds;
  }

  void invalid(const DracoPrimitive& draco, const std::string& place, std::string message) {
    issues_.invalid("DRACO_DATA_INVALID", pointer(draco) + place, std::move(message));
  }

  void place(const DracoPrimitive& draco, const draco::Mesh& mesh) {
    for (const auto& [name, id] : draco.attributes) {
      place_attribute(draco, mesh, name, id);
      if (issues_.failed()) return;
    }
    int& indices = primitive(draco).indices;
    const std::uint64_t corners = std::uint64_t{mesh.num_faces()} * 3;
    if (accessor(indices).count != corners) {
      return invalid(draco, "",
                     fmt::format("holds {} indices, accessor {} has {}", corners, indices,
                                 accessor(indices).count));
    }
    const auto known = faces_.find(indices);
    if (known != faces_.end()) {
      indices = known->second;
      return;
    }
    auto bytes = gather_faces(mesh, accessor(indices).componentType);
    if (!bytes) {
      return invalid(draco, "", fmt::format("an index is beyond the type of accessor {}", indices));
    }
    const int own = append(draco, indices, std::move(*bytes));
    faces_[indices] = own;
    indices = own;
  }

  void place_attribute(const DracoPrimitive& draco, const draco::Mesh& mesh,
                       const std::string& name, std::uint32_t id) {
    int& index = primitive(draco).attributes[name];
    const std::string place = "/attributes/" + pointer_key(name);
    const auto known = known_.find({id, index});
    if (known != known_.end()) {
      index = known->second;
      return;
    }
    const draco::PointAttribute* attribute = mesh.GetAttributeByUniqueId(id);
    if (!attribute) return invalid(draco, place, fmt::format("there is no attribute {}", id));
    const ElementLayout layout = element_layout(accessor(index));
    if (mesh.num_points() != accessor(index).count) {
      return invalid(draco, place,
                     fmt::format("holds {} points, accessor {} has {} elements", mesh.num_points(),
                                 index, accessor(index).count));
    }
    if (static_cast<std::size_t>(attribute->num_components()) != layout.components) {
      return invalid(
          draco, place,
          fmt::format("has {} components, accessor {} has {}",
                      static_cast<int>(attribute->num_components()), index, layout.components));
    }
    auto bytes = gather(mesh, *attribute, accessor(index).componentType, layout);
    if (!bytes) {
      return invalid(draco, place,
                     fmt::format("a value does not fit accessor {}, {}", index,
                                 format_name(accessor(index).type, accessor(index).componentType,
                                             accessor(index).normalized)));
    }
    const int own = append(draco, index, std::move(*bytes));
    known_[{id, index}] = own;
    index = own;
  }

  // A copy of the accessor that shows `bytes`. Accessors may be shared by many primitives, so that
  // the copies need more than the accessors do.
  int append(const DracoPrimitive& draco, int like, Bytes bytes) {
    total_ += bytes.size();  // each at most 2^31 * 64
    if (total_ > limits_.max_scene_bytes) {
      issues_.fail(util::Exit::limit, "LIMIT", pointer(draco),
                   fmt::format("Draco's primitives up to this one decode to {} bytes, "
                               "--max-scene-bytes allows {}",
                               total_, limits_.max_scene_bytes));
      return like;
    }
    tinygltf::BufferView view;
    view.buffer = static_cast<int>(model_.buffers.size());
    view.byteLength = bytes.size();
    tinygltf::Buffer buffer;
    buffer.data = std::move(bytes);
    tinygltf::Accessor own = accessor(like);
    own.bufferView = static_cast<int>(model_.bufferViews.size());
    own.byteOffset = 0;
    own.sparse.isSparse = false;
    model_.buffers.push_back(std::move(buffer));
    model_.bufferViews.push_back(std::move(view));
    model_.accessors.push_back(std::move(own));
    return static_cast<int>(model_.accessors.size()) - 1;
  }

  tinygltf::Model& model_;
  const util::Limits& limits_;
  Issues& issues_;
  std::uint64_t total_ = 0;                             // bytes appended
  std::map<std::pair<std::uint32_t, int>, int> known_;  // by Draco's id and former accessor
  std::map<int, int> faces_;                            // by former accessor
};

}  // namespace

void decode_draco(Structure& structure, const util::Limits& limits, Issues& issues) {
  std::map<std::size_t, std::vector<const DracoPrimitive*>> by_view;
  for (const DracoPrimitive& draco : structure.draco) by_view[draco.view].push_back(&draco);
  Decoder decoder(structure, limits, issues);
  for (const auto& [view, primitives] : by_view) {
    decoder.decode(primitives);
    if (issues.failed()) return;
  }
}

}  // namespace octrace::gltf
