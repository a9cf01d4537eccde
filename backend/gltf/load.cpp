// The order of validation: container, JSON, structure, links, then bytes and what they say. Nothing
// is read before all that bounds it has been checked.
#include <algorithm>
#include <utility>

#include "backend/gltf/data_checks.h"
#include "backend/gltf/document.h"
#include "backend/gltf/draco.h"
#include "backend/gltf/files.h"
#include "backend/gltf/glb.h"
#include "backend/gltf/instancing.h"
#include "backend/gltf/json_ref.h"
#include "backend/gltf/links.h"
#include "backend/gltf/meshopt.h"
#include "backend/gltf/model.h"
#include "backend/gltf/resources.h"
#include "backend/gltf/structure.h"

namespace octrace::gltf {
namespace {

using Bytes = std::vector<std::uint8_t>;

// By content; the name only decides what broken content was meant to be.
bool is_glb(const Bytes& bytes, const std::string& name) {
  if (has_glb_magic(bytes)) return true;
  std::size_t first = bytes.size() >= 3 && bytes[0] == 0xef && bytes[1] == 0xbb ? 3 : 0;
  while (first < bytes.size() && (bytes[first] == ' ' || bytes[first] == '\n' ||
                                  bytes[first] == '\r' || bytes[first] == '\t')) {
    ++first;
  }
  if (first < bytes.size() && bytes[first] == '{') return false;
  return name.ends_with(".glb") || name.ends_with(".GLB");
}

std::optional<Json> read_json(Bytes& bytes, const util::Limits& limits, std::optional<Bytes>& bin,
                              Issues& issues) {
  if (!is_glb(bytes, issues.file())) {
    return parse_json({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, limits, issues);
  }
  const GlbChunks chunks = parse_glb(bytes, issues);
  if (issues.failed()) return std::nullopt;
  Json root = parse_json(chunks.json, limits, issues);
  if (chunks.bin) {
    // Moved to the front in place: a second copy would double the memory of a large scene.
    const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(chunks.bin->offset);
    std::move(begin, begin + static_cast<std::ptrdiff_t>(chunks.bin->size), bytes.begin());
    bytes.resize(chunks.bin->size);
    bin = std::move(bytes);
  }
  return root;
}

void drop_untargeted_channels(tinygltf::Model& model) {
  for (auto& animation : model.animations) {
    std::erase_if(animation.channels, [](const auto& channel) { return channel.target_node < 0; });
  }
}

void load_into(Document& document, Bytes bytes, const SceneFolder& folder,
               const LoadOptions& options, Issues& issues) {
  std::optional<Bytes> bin;
  std::optional<Json> root = read_json(bytes, options.limits, bin, issues);
  bytes = {};
  if (issues.failed()) return;
  check_structure(JsonRef(*root, issues), options.limits);
  if (issues.failed()) return;
  Structure structure = make_model(std::move(*root), issues);
  if (issues.failed()) return;
  check_accessor_links(structure.model, options.limits, issues);
  if (issues.failed()) return;
  check_mesh_links(structure.model, issues);
  check_skin_links(structure.model, issues);
  check_instancing_links(structure.model, options.limits, issues);
  if (issues.failed()) return;
  check_animation_links(structure.model, issues);
  if (issues.failed()) return;
  load_buffers(structure, std::move(bin), folder, options.limits, issues);
  if (issues.failed()) return;
  decode_meshopt(structure, options.limits, issues);
  if (issues.failed()) return;
  decode_draco(structure, options.limits, issues);
  if (issues.failed()) return;
  check_data(structure.model, issues);
  if (!issues.failed()) check_instance_rotations(structure.model, issues);
  if (issues.failed()) return;
  document.images = load_images(structure, folder, options, issues);
  if (issues.failed()) return;
  drop_untargeted_channels(structure.model);
  document.model = std::move(structure.model);
}

util::Result<Document> load_from(Bytes bytes, const std::string& name, const SceneFolder& folder,
                                 const LoadOptions& options) {
  Issues issues(name);
  Document document;
  document.file = name;
  load_into(document, std::move(bytes), folder, options, issues);
  if (issues.failed()) return issues.take_error();
  document.warnings = issues.take_warnings();
  return document;
}

}  // namespace

util::Result<Document> load(const std::string& path, const LoadOptions& options) {
  auto bytes = read_regular_file(path, options.limits.max_file_bytes);
  if (!bytes) {
    bytes.error().file = path;
    return std::move(bytes.error());
  }
  return load_from(std::move(*bytes), path, SceneFolder::of(path), options);
}

util::Result<Document> load_bytes(std::vector<std::uint8_t> bytes, const std::string& name,
                                  const LoadOptions& options) {
  return load_from(std::move(bytes), name, SceneFolder::none(), options);
}

}  // namespace octrace::gltf
