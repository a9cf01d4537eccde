#include "tests/bench/bench_scene.h"

#include "backend/gltf/document.h"
#include "backend/scene/builtin.h"
#include "backend/scene/flatten.h"

namespace octrace::bench {

util::Result<scene::Scene> load_scene(const std::string& name) {
  if (name.starts_with(scene::kBuiltinPrefix)) {
    return scene::make_builtin(std::string_view(name).substr(scene::kBuiltinPrefix.size()));
  }
  gltf::LoadOptions load;
  load.missing_images_warn = true;
  util::Result<gltf::Document> document = gltf::load(name, load);
  if (!document) return document.error();
  scene::FlattenOptions flatten;
  flatten.need_textures = false;
  flatten.missing_images_warn = true;
  flatten.decode = [](std::span<const std::uint8_t>, const std::string&,
                      const util::Limits&) -> util::Result<scene::DecodedImage> {
    return util::Error{util::Exit::unsupported, "", "benchmarks decode no images", "", ""};
  };
  return scene::flatten(*document, flatten);
}

util::Result<scene::Camera> choose_camera(const scene::Scene& scene, const std::string& name,
                                          double aspect) {
  if (name.empty()) {
    return scene.cameras.empty() ? scene::frame_bounds(scene.bounds, aspect) : scene.cameras[0];
  }
  for (const scene::Camera& camera : scene.cameras) {
    if (camera.name == name) return camera;
  }
  return util::Error{util::Exit::usage, "", "the scene has no camera named " + name, "", ""};
}

}  // namespace octrace::bench
