#include "tests/property/oracle_scenes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "backend/gltf/document.h"
#include "backend/image/image.h"
#include "backend/scene/flatten.h"

namespace octrace::tests {

std::vector<std::string> oracle_scene_files() {
  std::vector<std::string> files;
  const std::filesystem::path folder = std::filesystem::path(OCTRACE_SHARED_SCENES) / "valid";
  if (!std::filesystem::exists(folder)) return files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const auto extension = entry.path().extension();
    if (extension == ".gltf" || extension == ".glb") files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::unique_ptr<OracleScene> load_oracle_scene(const std::string& file, double aspect) {
  util::Result<gltf::Document> document = gltf::load(file, {});
  if (!document) {
    ADD_FAILURE() << document.error().to_string();
    return nullptr;
  }
  scene::FlattenOptions options;
  options.decode = [](std::span<const std::uint8_t> bytes, const std::string& mime,
                      const util::Limits& limits) -> util::Result<scene::DecodedImage> {
    util::Result<image::Rgba8> image = image::decode(bytes, mime, limits);
    if (!image) return image.error();
    return scene::DecodedImage{image->width, image->height, std::move(image->texels)};
  };
  util::Result<scene::Scene> scene = scene::flatten(*document, options);
  if (!scene) {
    ADD_FAILURE() << scene.error().to_string();
    return nullptr;
  }
  auto loaded = std::make_unique<OracleScene>();
  loaded->scene = std::move(*scene);
  util::Result<octree::Octree> octree = octree::build(loaded->scene, {});
  if (!octree) {
    ADD_FAILURE() << octree.error().to_string();
    return nullptr;
  }
  loaded->octree = std::move(*octree);
  loaded->view = loaded->scene.view();
  loaded->view.octree = loaded->octree.view();
  loaded->camera = loaded->scene.cameras.empty() ? scene::frame_bounds(loaded->scene.bounds, aspect)
                                                 : loaded->scene.cameras[0];
  return loaded;
}

}  // namespace octrace::tests
