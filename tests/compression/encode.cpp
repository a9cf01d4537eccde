#include "tests/compression/encode.h"

#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numeric>
#include <set>

#include "backend/gltf/accessor.h"
#include "backend/scene/builtin.h"
#include "exporters/gltf/gltf.h"
#include "tests/malformed/base_scene.h"

namespace octrace::tests {
namespace {

using nlohmann::json;

gltf::Document document_of(const Parts& parts) {
  auto document = gltf::load_bytes(parts.glb(), "parts.glb", {});
  if (document) return std::move(*document);
  ADD_FAILURE() << document.error().to_string();
  return {};
}

Bytes encode_attributes(const std::uint8_t* data, std::size_t count, std::size_t stride) {
  Bytes out(meshopt_encodeVertexBufferBound(count, stride));
  out.resize(meshopt_encodeVertexBuffer(out.data(), out.size(), data, count, stride));
  return out;
}

Bytes encode_indices(const std::vector<std::uint32_t>& indices, bool triangles) {
  const std::size_t vertices = *std::max_element(indices.begin(), indices.end()) + std::size_t{1};
  if (triangles) {
    Bytes out(meshopt_encodeIndexBufferBound(indices.size(), vertices));
    out.resize(meshopt_encodeIndexBuffer(out.data(), out.size(), indices.data(), indices.size()));
    return out;
  }
  Bytes out(meshopt_encodeIndexSequenceBound(indices.size(), vertices));
  out.resize(meshopt_encodeIndexSequence(out.data(), out.size(), indices.data(), indices.size()));
  return out;
}

template <class T>
void add_values(draco::PointAttribute& attribute, const std::vector<T>& values, int components) {
  for (std::size_t i = 0; i < values.size() / static_cast<std::size_t>(components); ++i) {
    attribute.SetAttributeValue(draco::AttributeValueIndex(static_cast<std::uint32_t>(i)),
                                &values[i * static_cast<std::size_t>(components)]);
  }
}

// Draco's ids are made unlike the attributes' positions, which readers may not take them for.
constexpr std::uint32_t kFirstId = 7;

std::uint32_t add_attribute(draco::Mesh& mesh, const gltf::Document& document,
                            const std::string& name, int index) {
  const auto& accessor = document.model.accessors[static_cast<std::size_t>(index)];
  const auto layout = gltf::element_layout(accessor);
  const int components = static_cast<int>(layout.components);
  using Kind = draco::GeometryAttribute;
  const Kind::Type kind = name == "POSITION"              ? Kind::POSITION
                          : name == "NORMAL"              ? Kind::NORMAL
                          : name.starts_with("TEXCOORD_") ? Kind::TEX_COORD
                          : name.starts_with("COLOR_")    ? Kind::COLOR
                                                          : Kind::GENERIC;
  const draco::DataType type =
      accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE    ? draco::DT_UINT8
      : accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ? draco::DT_UINT16
                                                                         : draco::DT_FLOAT32;
  draco::GeometryAttribute attribute;
  attribute.Init(kind, nullptr, static_cast<std::int8_t>(components), type, accessor.normalized,
                 static_cast<std::int64_t>(layout.bytes), 0);
  const int at = mesh.AddAttribute(attribute, true, static_cast<std::uint32_t>(accessor.count));
  draco::PointAttribute& values = *mesh.attribute(at);
  if (type == draco::DT_FLOAT32) {
    add_values(values, document.read_floats(index), components);
  } else {
    const auto uints = document.read_uints(index);
    if (type == draco::DT_UINT8) {
      add_values(values, Bytes(uints.begin(), uints.end()), components);
    } else {
      add_values(values, std::vector<std::uint16_t>(uints.begin(), uints.end()), components);
    }
  }
  values.set_unique_id(kFirstId + 2 * static_cast<std::uint32_t>(at));
  return values.unique_id();
}

void encode_primitive(Parts& parts, const gltf::Document& document, std::size_t m, std::size_t p,
                      DracoMethod method, DracoValues values) {
  const auto& source = document.model.meshes[m].primitives[p];
  const std::size_t vertices =
      document.model.accessors[static_cast<std::size_t>(source.attributes.begin()->second)].count;
  std::vector<std::uint32_t> indices(vertices);
  std::iota(indices.begin(), indices.end(), 0u);
  if (source.indices >= 0) indices = document.read_uints(source.indices);

  draco::Mesh mesh;
  mesh.set_num_points(static_cast<std::uint32_t>(vertices));
  for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
    mesh.AddFace({draco::PointIndex(indices[i]), draco::PointIndex(indices[i + 1]),
                  draco::PointIndex(indices[i + 2])});
  }
  json& primitive = parts.root["meshes"][m]["primitives"][p];
  json ids;
  for (const auto& [name, index] : source.attributes) {
    ids[name] = add_attribute(mesh, document, name, index);
  }
  draco::Encoder encoder;
  encoder.SetEncodingMethod(method == DracoMethod::sequential ? draco::MESH_SEQUENTIAL_ENCODING
                                                              : draco::MESH_EDGEBREAKER_ENCODING);
  if (values == DracoValues::quantised) {
    encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 11);
    encoder.SetAttributeQuantization(draco::GeometryAttribute::TEX_COORD, 10);
    encoder.SetSpeedOptions(0, 0);
  }
  encoder.SetTrackEncodedProperties(true);
  draco::EncoderBuffer buffer;
  ASSERT_TRUE(encoder.EncodeMeshToBuffer(mesh, &buffer).ok());
  const auto* begin = reinterpret_cast<const std::uint8_t*>(buffer.data());
  const int view = parts.append_view(Bytes(begin, begin + buffer.size()));

  const auto append = [&](json accessor, std::size_t count) {
    for (const char* key : {"bufferView", "byteOffset", "sparse"}) accessor.erase(key);
    accessor["count"] = count;
    parts.root["accessors"].push_back(std::move(accessor));
    return parts.root["accessors"].size() - 1;
  };
  const json accessors = parts.root["accessors"];
  for (const auto& [name, index] : source.attributes) {
    primitive["attributes"][name] =
        append(accessors[static_cast<std::size_t>(index)], encoder.num_encoded_points());
  }
  primitive["indices"] =
      append({{"componentType", 5125}, {"type", "SCALAR"}}, encoder.num_encoded_faces() * 3);
  primitive["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", view},
                                                           {"attributes", ids}};
}

}  // namespace

Bytes Parts::glb() const { return make_glb(root.dump(), bin); }

int Parts::append_view(const Bytes& bytes) {
  bin.resize((bin.size() + 3) / 4 * 4);
  root["bufferViews"].push_back(
      {{"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", bytes.size()}});
  bin.insert(bin.end(), bytes.begin(), bytes.end());
  root["buffers"][0]["byteLength"] = bin.size();
  return static_cast<int>(root["bufferViews"].size()) - 1;
}

void use_extension(json& root, const std::string& name, bool required) {
  root["extensionsUsed"].push_back(name);
  if (required) root["extensionsRequired"].push_back(name);
}

Parts parts_of_file(const std::string& path) {
  Parts parts;
  std::ifstream stream(path, std::ios::binary);
  const Bytes file{std::istreambuf_iterator<char>(stream), {}};
  if (file.size() > 20 && std::memcmp(file.data(), "glTF", 4) == 0) {
    std::uint32_t length = 0;
    std::memcpy(&length, file.data() + 12, sizeof length);
    parts.root = json::parse(file.begin() + 20, file.begin() + 20 + length);
  } else {
    parts.root = json::parse(file.begin(), file.end());
  }
  const auto document = gltf::load(path, {});
  if (!document) {
    ADD_FAILURE() << document.error().to_string();
    return parts;
  }
  std::vector<std::size_t> offsets;
  for (const auto& buffer : document->model.buffers) {
    parts.bin.resize((parts.bin.size() + 3) / 4 * 4);
    offsets.push_back(parts.bin.size());
    parts.bin.insert(parts.bin.end(), buffer.data.begin(), buffer.data.end());
  }
  for (json& view : parts.root["bufferViews"]) {
    view["byteOffset"] =
        view.value("byteOffset", std::size_t{0}) + offsets[view["buffer"].get<std::size_t>()];
    view["buffer"] = 0;
  }
  parts.root["buffers"] = json::array({{{"byteLength", parts.bin.size()}}});
  if (parts.root.contains("images")) {
    for (json& image : parts.root["images"]) image = {{"uri", data_uri(tiny_png(), "image/png")}};
  }
  return parts;
}

Parts parts_of_builtin(const std::string& name) {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  const std::string path = testing::TempDir() + "octrace_" + test->test_suite_name() + "_" +
                           test->name() + "_" + name.substr(0, name.find(':')) + ".glb";
  const auto scene = scene::make_builtin(name, {});
  EXPECT_TRUE(scene && exporters::write_gltf(*scene, path));
  Parts parts = parts_of_file(path);
  std::filesystem::remove(path);
  return parts;
}

int meshopt_encode(Parts& parts, const MeshoptOptions& options) {
  const gltf::Document document = document_of(parts);
  json& root = parts.root;
  std::vector<std::size_t> element(root["bufferViews"].size(), 4);
  std::vector<int> users(root["bufferViews"].size());
  for (std::size_t i = 0; i < root["accessors"].size(); ++i) {
    const json& accessor = root["accessors"][i];
    if (!accessor.contains("bufferView")) continue;
    const auto view = accessor["bufferView"].get<std::size_t>();
    element[view] = gltf::element_layout(document.model.accessors[i]).bytes;
    ++users[view];
  }
  std::vector<int> index_accessor(root["bufferViews"].size(), -1);
  for (const auto& mesh : document.model.meshes) {
    for (const auto& primitive : mesh.primitives) {
      if (primitive.indices < 0) continue;
      const auto& accessor = document.model.accessors[static_cast<std::size_t>(primitive.indices)];
      if (accessor.bufferView >= 0 && accessor.byteOffset == 0 &&
          accessor.componentType != TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE) {
        index_accessor[static_cast<std::size_t>(accessor.bufferView)] = primitive.indices;
      }
    }
  }
  Parts out;
  int compressed = 0;
  for (std::size_t i = 0; i < root["bufferViews"].size(); ++i) {
    json& view = root["bufferViews"][i];
    const auto length = view["byteLength"].get<std::size_t>();
    const std::uint8_t* data = parts.bin.data() + view.value("byteOffset", std::size_t{0});
    json json_view = {{"buffer", 0}};
    Bytes bytes;
    if (index_accessor[i] >= 0 && users[i] == 1) {
      const auto indices = document.read_uints(index_accessor[i]);
      const bool triangles = options.triangles && indices.size() % 3 == 0;
      if (length % element[i] == 0 && indices.size() == length / element[i]) {
        bytes = encode_indices(indices, triangles);
        json_view["mode"] = triangles ? "TRIANGLES" : "INDICES";
        json_view["byteStride"] = element[i];
      }
    } else if (users[i] > 0) {
      std::size_t stride = view.value("byteStride", element[i]);
      if (stride % 4 != 0 || length % stride != 0) stride = 4;
      if (length % stride == 0) {
        bytes = encode_attributes(data, length / stride, stride);
        json_view["mode"] = "ATTRIBUTES";
        json_view["byteStride"] = stride;
      }
    }
    out.bin.resize((out.bin.size() + 3) / 4 * 4);
    if (bytes.empty()) {
      view["byteOffset"] = out.bin.size();
      out.bin.insert(out.bin.end(), data, data + length);
      continue;
    }
    ++compressed;
    json_view["byteOffset"] = out.bin.size();
    json_view["byteLength"] = bytes.size();
    json_view["count"] = length / json_view["byteStride"].get<std::size_t>();
    view["buffer"] = 1;
    view["extensions"]["EXT_meshopt_compression"] = json_view;
    out.bin.insert(out.bin.end(), bytes.begin(), bytes.end());
  }
  root["buffers"] =
      json::array({{{"byteLength", out.bin.size()}},
                   {{"byteLength", parts.bin.size()},
                    {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}});
  use_extension(root, "EXT_meshopt_compression");
  parts.bin = std::move(out.bin);
  return compressed;
}

int draco_encode(Parts& parts, DracoMethod method, DracoValues values) {
  const gltf::Document document = document_of(parts);
  int compressed = 0;
  for (std::size_t m = 0; m < document.model.meshes.size(); ++m) {
    const auto& primitives = document.model.meshes[m].primitives;
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      const bool morphed = !primitives[p].targets.empty() && method == DracoMethod::edgebreaker;
      if (primitives[p].mode != TINYGLTF_MODE_TRIANGLES || morphed) continue;
      encode_primitive(parts, document, m, p, method, values);
      ++compressed;
    }
  }
  if (compressed > 0) use_extension(parts.root, "KHR_draco_mesh_compression");
  return compressed;
}

}  // namespace octrace::tests
