#include "tests/gpu/load.h"

#include <gtest/gtest.h>

#include "backend/gltf/document.h"
#include "backend/scene/builtin.h"
#include "backend/scene/flatten.h"

namespace octrace::tests {

namespace {

util::Result<scene::DecodedImage> hashed_image(std::span<const std::uint8_t> bytes,
                                               const std::string&, const util::Limits&) {
  std::uint32_t state = 2166136261u;
  for (const std::uint8_t byte : bytes) state = (state ^ byte) * 16777619u;
  scene::DecodedImage image;
  image.width = 5 + state % 60;
  image.height = 3 + state / 64 % 60;
  for (std::uint32_t i = 0; i < image.width * image.height; ++i) {
    state = state * 747796405u + 2891336453u;
    image.texels.push_back((state >> 16) * 0x9e3779b1u ^ state);
  }
  return image;
}

util::Result<scene::Scene> load_scene(const std::string& source) {
  if (source.starts_with(scene::kBuiltinPrefix)) {
    return scene::make_builtin(std::string_view(source).substr(scene::kBuiltinPrefix.size()));
  }
  util::Result<gltf::Document> document = gltf::load(source, {});
  if (!document) return document.error();
  scene::FlattenOptions options;
  options.decode = hashed_image;
  return scene::flatten(*document, options);
}

}  // namespace

std::unique_ptr<LoadedScene> load_for_device_test(const std::string& source) {
  util::Result<scene::Scene> scene = load_scene(source);
  if (!scene) {
    ADD_FAILURE() << scene.error().to_string();
    return nullptr;
  }
  util::Result<octree::Octree> octree = octree::build(*scene, {});
  if (!octree) {
    ADD_FAILURE() << octree.error().to_string();
    return nullptr;
  }
  return std::make_unique<LoadedScene>(LoadedScene{std::move(*scene), std::move(*octree)});
}

scene::Camera first_camera(const scene::Scene& scene, double aspect) {
  return scene.cameras.empty() ? scene::frame_bounds(scene.bounds, aspect) : scene.cameras[0];
}

}  // namespace octrace::tests
