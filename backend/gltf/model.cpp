#include "backend/gltf/model.h"

#include "backend/gltf/uri.h"

namespace octrace::gltf {
namespace {

std::string take_string(Json& object, const char* key) {
  const auto it = object.find(key);
  return it == object.end() ? std::string() : std::move(it->get_ref<std::string&>());
}

int index_or_none(const Json& object, const char* key) {
  const auto it = object.find(key);
  return it == object.end() ? -1 : it->get<int>();
}

void take_buffers(Json& root, Structure& structure) {
  if (!root.contains("buffers")) return;
  for (Json& object : root["buffers"]) {
    Source source;
    source.uri = take_string(object, "uri");
    source.byte_length = object["byteLength"].get<std::uint64_t>();
    tinygltf::Buffer buffer;
    buffer.name = take_string(object, "name");
    if (!is_data_uri(source.uri)) buffer.uri = source.uri;
    structure.model.buffers.push_back(std::move(buffer));
    structure.buffers.push_back(std::move(source));
  }
  root.erase("buffers");
}

constexpr const char* kMeshopt = "EXT_meshopt_compression";
constexpr const char* kDraco = "KHR_draco_mesh_compression";

const Json* extension(const Json& object, const char* name) {
  const auto extensions = object.find("extensions");
  if (extensions == object.end()) return nullptr;
  const auto found = extensions->find(name);
  return found == extensions->end() ? nullptr : &*found;
}

// tinygltf keeps an extension's integers as int, which is too short for offsets, so compression is
// read here.
MeshoptView meshopt_view(const Json& json, std::size_t view) {
  using Mode = MeshoptView::Mode;
  using Filter = MeshoptView::Filter;
  MeshoptView out;
  out.view = view;
  out.buffer = json["buffer"].get<std::size_t>();
  out.byte_offset = json.value("byteOffset", std::uint64_t{0});
  out.byte_length = json["byteLength"].get<std::uint64_t>();
  out.byte_stride = json["byteStride"].get<std::uint64_t>();
  out.count = json["count"].get<std::uint64_t>();
  const std::string mode = json["mode"].get<std::string>();
  out.mode = mode == "TRIANGLES" ? Mode::triangles
             : mode == "INDICES" ? Mode::indices
                                 : Mode::attributes;
  const std::string filter = json.value("filter", "NONE");
  out.filter = filter == "OCTAHEDRAL"    ? Filter::octahedral
               : filter == "QUATERNION"  ? Filter::quaternion
               : filter == "EXPONENTIAL" ? Filter::exponential
                                         : Filter::none;
  return out;
}

void read_compression(const Json& root, Structure& structure) {
  const auto array = [&](const char* key) -> const Json& {
    static const Json kEmpty = Json::array();
    const auto found = root.find(key);
    return found == root.end() ? kEmpty : *found;
  };
  for (const Json& buffer : array("buffers")) {
    const Json* fallback = extension(buffer, kMeshopt);
    structure.fallback_buffers.push_back(fallback && fallback->value("fallback", false));
  }
  const Json& views = array("bufferViews");
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (const Json* json = extension(views[i], kMeshopt)) {
      structure.meshopt.push_back(meshopt_view(*json, i));
    }
  }
  const Json& meshes = array("meshes");
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    const Json& primitives = meshes[m]["primitives"];
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      const Json* json = extension(primitives[p], kDraco);
      if (!json) continue;
      DracoPrimitive draco{m, p, (*json)["bufferView"].get<std::size_t>(), {}};
      for (const auto& [name, id] : (*json)["attributes"].items()) {
        draco.attributes[name] = id.get<std::uint32_t>();
      }
      structure.draco.push_back(std::move(draco));
    }
  }
}

void take_images(Json& root, Structure& structure) {
  if (!root.contains("images")) return;
  for (Json& object : root["images"]) {
    Source source;
    source.uri = take_string(object, "uri");
    tinygltf::Image image;
    image.name = take_string(object, "name");
    image.mimeType = take_string(object, "mimeType");
    image.bufferView = index_or_none(object, "bufferView");
    if (!is_data_uri(source.uri)) image.uri = source.uri;
    structure.model.images.push_back(std::move(image));
    structure.images.push_back(std::move(source));
  }
  root.erase("images");
}

struct TakenIndices {
  std::size_t mesh, primitive;
  int accessor;
};

// tinygltf refuses indices whose accessor has no buffer view, which glTF allows (zeros, or sparse
// values over zeros), so such indices pass it by.
std::vector<TakenIndices> take_indices_without_view(Json& root) {
  std::vector<TakenIndices> taken;
  if (!root.contains("meshes")) return taken;
  Json& meshes = root["meshes"];
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    Json& primitives = meshes[m]["primitives"];
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      const int accessor = index_or_none(primitives[p], "indices");
      if (accessor < 0) continue;
      if (root["accessors"][static_cast<std::size_t>(accessor)].contains("bufferView")) continue;
      primitives[p].erase("indices");
      taken.push_back({m, p, accessor});
    }
  }
  return taken;
}

// tinygltf drops channels without a target node, which would shift the ones behind them; with this
// index they stay, and are dropped when all checks are done.
void mark_untargeted_channels(Json& root) {
  if (!root.contains("animations")) return;
  for (Json& animation : root["animations"]) {
    for (Json& channel : animation["channels"]) {
      Json& target = channel["target"];
      if (!target.contains("node")) target["node"] = -1;
    }
  }
}

bool same_sizes(const tinygltf::Model& model, const Json& root) {
  const auto same = [&](const char* key, std::size_t size) {
    return size == (root.contains(key) ? root[key].size() : 0);
  };
  return same("accessors", model.accessors.size()) && same("animations", model.animations.size()) &&
         same("bufferViews", model.bufferViews.size()) && same("cameras", model.cameras.size()) &&
         same("materials", model.materials.size()) && same("meshes", model.meshes.size()) &&
         same("nodes", model.nodes.size()) && same("samplers", model.samplers.size()) &&
         same("scenes", model.scenes.size()) && same("skins", model.skins.size()) &&
         same("textures", model.textures.size());
}

}  // namespace

Structure make_model(Json root, Issues& issues) {
  Structure structure;
  read_compression(root, structure);
  take_buffers(root, structure);
  take_images(root, structure);
  const auto taken = take_indices_without_view(root);
  mark_untargeted_channels(root);
  const std::string text = root.dump();

  tinygltf::TinyGLTF reader;
  tinygltf::Model model;
  std::string errors, warnings;
  const bool read =
      reader.LoadASCIIFromString(&model, &errors, &warnings, text.data(),
                                 static_cast<unsigned int>(text.size()), "", tinygltf::NO_REQUIRE);
  if (!read || !same_sizes(model, root)) {
    // check_structure lets nothing through that tinygltf refuses, so this is a bug in one of them.
    issues.fail(util::Exit::internal, "", "", "tinygltf refuses a checked file: " + quote(errors));
    return structure;
  }
  model.buffers = std::move(structure.model.buffers);
  model.images = std::move(structure.model.images);
  structure.model = std::move(model);
  for (const auto& [mesh, primitive, accessor] : taken) {
    structure.model.meshes[mesh].primitives[primitive].indices = accessor;
  }
  return structure;
}

}  // namespace octrace::gltf
