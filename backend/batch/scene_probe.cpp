#include "backend/batch/scene_probe.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <cstring>

#include "backend/gltf/files.h"
#include "backend/gltf/glb.h"
#include "backend/gltf/issues.h"
#include "backend/gltf/json_text.h"
#include "backend/gltf/uri.h"
#include "backend/scene/builtin.h"

namespace octrace::batch {

namespace {

// The JSON of a .gltf or .glb; of the latter no more than the first chunk is read.
std::optional<Json> read_gltf_json(const std::string& path, const util::Limits& limits) {
  constexpr std::uint64_t kHeader = 20;  // of the file, then of its first chunk
  auto bytes = gltf::read_regular_file(path, limits.max_file_bytes, kHeader);
  if (!bytes) return std::nullopt;
  gltf::Issues issues(path);
  std::size_t skip = 0;
  if (gltf::has_glb_magic(*bytes) && bytes->size() == kHeader) {
    std::uint32_t length = 0;
    std::memcpy(&length, bytes->data() + 12, 4);
    bytes = gltf::read_regular_file(path, limits.max_file_bytes, kHeader + length);
    skip = kHeader;
  } else {
    bytes = gltf::read_regular_file(path, limits.max_file_bytes);
  }
  if (!bytes || bytes->size() < skip) return std::nullopt;
  Json json = gltf::parse_json(
      {reinterpret_cast<const char*>(bytes->data()) + skip, bytes->size() - skip}, limits, issues);
  if (issues.failed()) return std::nullopt;
  return json;
}

// An index member, or nothing where it is missing or none of `count`.
std::optional<std::size_t> index_of(const Json& object, const char* key, std::size_t count) {
  const auto member = object.find(key);
  if (member == object.end() || !member->is_number_unsigned()) return std::nullopt;
  const auto index = member->get<std::size_t>();
  return index < count ? std::optional(index) : std::nullopt;
}

const Json& list(const Json& object, const char* key) {
  static const Json kNone = Json::array();
  if (!object.is_object()) return kNone;
  const auto member = object.find(key);
  return member == object.end() || !member->is_array() ? kNone : *member;
}

// The nodes that a scene shows; the same rules as scene::flatten().
std::vector<bool> shown_nodes(const Json& gltf, std::optional<int> chosen) {
  const Json& nodes = list(gltf, "nodes");
  const Json& scenes = list(gltf, "scenes");
  std::vector<bool> shown(nodes.size(), scenes.empty());
  if (scenes.empty()) return shown;
  const std::size_t index = chosen ? static_cast<std::size_t>(*chosen)
                                   : index_of(gltf, "scene", scenes.size()).value_or(0);
  if (index >= scenes.size()) return shown;
  std::vector<std::size_t> pending;
  const auto add = [&](const Json& indices) {
    for (const Json& item : indices) {
      if (item.is_number_unsigned() && item.get<std::size_t>() < nodes.size()) {
        pending.push_back(item.get<std::size_t>());
      }
    }
  };
  add(list(scenes[index], "nodes"));
  while (!pending.empty()) {
    const std::size_t node = pending.back();
    pending.pop_back();
    if (shown[node]) continue;
    shown[node] = true;
    add(list(nodes[node], "children"));
  }
  return shown;
}

std::string name_in(const Json& object) {
  const auto name = object.find("name");
  return name != object.end() && name->is_string() ? name->get<std::string>() : std::string();
}

std::string stat_text(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return "";
  return fmt::format("{} bytes, {}.{:09}", status.st_size, status.st_mtim.tv_sec,
                     status.st_mtim.tv_nsec);
}

}  // namespace

std::optional<std::vector<std::string>> probe_cameras(const JobScene& scene,
                                                      const util::Limits& limits) {
  std::vector<std::string> names;
  if (scene.source.starts_with(scene::kBuiltinPrefix)) {
    const auto made =
        scene::make_builtin(scene.source.substr(scene::kBuiltinPrefix.size()), limits);
    if (!made) return std::nullopt;
    for (const scene::Camera& camera : made->cameras) names.push_back(camera.name);
    return names;
  }
  const std::optional<Json> gltf = read_gltf_json(scene.source, limits);
  if (!gltf) return std::nullopt;
  const Json& nodes = list(*gltf, "nodes");
  const Json& cameras = list(*gltf, "cameras");
  const std::vector<bool> shown = shown_nodes(*gltf, scene.scene);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (!shown[i] || !nodes[i].is_object()) continue;
    const auto camera = index_of(nodes[i], "camera", cameras.size());
    if (!camera) continue;
    std::string name = name_in(nodes[i]);
    if (name.empty() && cameras[*camera].is_object()) name = name_in(cameras[*camera]);
    names.push_back(name.empty() ? fmt::format("camera {}", *camera) : name);
  }
  return names;
}

std::string file_identity(const JobScene& scene, const util::Limits& limits) {
  if (scene.source.starts_with(scene::kBuiltinPrefix)) return "";
  std::string identity = stat_text(scene.source);
  if (!scene.source.ends_with(".gltf")) return identity;
  const std::optional<Json> gltf = read_gltf_json(scene.source, limits);
  if (!gltf) return identity;
  const std::string folder = scene.source.substr(0, scene.source.rfind('/') + 1);
  for (const char* kind : {"buffers", "images"}) {
    for (const Json& item : list(*gltf, kind)) {
      if (!item.is_object()) continue;
      const auto uri = item.find("uri");
      if (uri == item.end() || !uri->is_string()) continue;
      const auto& text = uri->get_ref<const std::string&>();
      if (gltf::is_data_uri(text)) continue;
      const auto path = gltf::relative_path(text);
      if (path) identity += fmt::format("; {}: {}", *path, stat_text(folder + *path));
    }
  }
  return identity;
}

}  // namespace octrace::batch
