#include "backend/app/validation_views.h"

#include <fmt/format.h>

#include <algorithm>
#include <glm/gtc/matrix_transform.hpp>
#include <memory>

#include "backend/batch/camera_choice.h"
#include "backend/render/renderer.h"
#include "backend/util/interrupt.h"

namespace octrace::app {

namespace {

constexpr std::size_t kFramings = 3;
// Less than this share of the pixels says little about a scene.
constexpr double kLeastCoverage = 0.01;

struct Framing {
  const char* name;
  double turn, tilt;  // degrees about +Y, then about +X, from frame_bounds' own direction
};
constexpr Framing kCandidates[] = {{"front", 0, 0},        {"behind", 150, 0}, {"below", 35, -85},
                                   {"left", -75, 0},       {"above", 10, 40},  {"right", 60, -20},
                                   {"underside", 200, -70}};

// The camera that frames the bounds, turned about their centre. Every corner stays in view: what is
// framed is the box around the bounds turned the other way.
scene::Camera framing(const scene::Bounds& bounds, double aspect, const Framing& candidate) {
  const glm::dvec3 centre = 0.5 * (glm::dvec3(bounds.lower) + glm::dvec3(bounds.upper));
  const glm::dmat4 turn =
      glm::rotate(glm::dmat4(1.0), glm::radians(candidate.turn), glm::dvec3(0, 1, 0)) *
      glm::rotate(glm::dmat4(1.0), glm::radians(candidate.tilt), glm::dvec3(1, 0, 0));
  const glm::dmat4 about =
      glm::translate(glm::dmat4(1.0), centre) * turn * glm::translate(glm::dmat4(1.0), -centre);
  const glm::dmat4 back = glm::inverse(about);
  scene::Bounds turned;
  turned.empty = bounds.empty;
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec4 point(corner & 1 ? bounds.upper.x : bounds.lower.x,
                           corner & 2 ? bounds.upper.y : bounds.lower.y,
                           corner & 4 ? bounds.upper.z : bounds.lower.z, 1.0);
    const kernels::Vec3 moved(glm::dvec3(back * point));
    turned.lower = corner == 0 ? moved : glm::min(turned.lower, moved);
    turned.upper = corner == 0 ? moved : glm::max(turned.upper, moved);
  }
  scene::Camera camera = scene::frame_bounds(turned, aspect);
  camera.matrix = about * camera.matrix;
  camera.name = candidate.name;
  return camera;
}

double coverage(const validation::Planes& planes) {
  const auto covered = std::count(planes.mask.begin(), planes.mask.end(), 1);
  return static_cast<double>(covered) / static_cast<double>(planes.mask.size());
}

void make_names_unique(std::vector<scene::Camera>& cameras) {
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const auto same = [&](const scene::Camera& other) { return other.name == cameras[i].name; };
    if (cameras[i].name.empty() || std::count_if(cameras.begin(), cameras.end(), same) > 1) {
      cameras[i].name = fmt::format("{} ({})", cameras[i].name, i);
    }
  }
}

}  // namespace

util::Result<validation::Planes> render_planes(const scene::Scene& scene,
                                               const octree::Octree& octree,
                                               const scene::Camera& camera,
                                               const ViewOptions& options) {
  using kernels::Aov;
  render::AovSet aovs;
  for (const Aov aov : {Aov::depth, Aov::mask, Aov::object_id}) {
    aovs.set(static_cast<std::size_t>(aov));
  }
  render::Framebuffer framebuffer(options.size.width, options.size.height, aovs);
  render::Settings settings;
  settings.params.cull = options.cull;
  settings.params.alpha = options.alpha;
  settings.threads = options.threads;
  settings.cancel = &util::interrupt_flag();
  const std::unique_ptr<render::Renderer> renderer =
      render::make_renderer(scene, octree, options.device);
  const auto traced =
      renderer->render(scene::make_ray_camera(camera, static_cast<int>(options.size.width),
                                              static_cast<int>(options.size.height)),
                       settings, framebuffer);
  if (!traced) return traced.error();

  validation::Planes planes;
  planes.width = options.size.width;
  planes.height = options.size.height;
  const auto depth = framebuffer.floats(Aov::depth), mask = framebuffer.floats(Aov::mask);
  const auto ids = framebuffer.uints(Aov::object_id);
  planes.z.assign(depth.begin(), depth.end());
  planes.object_id.assign(ids.begin(), ids.end());
  for (const float value : mask) planes.mask.push_back(value > 0.5f);
  planes.depth_channel = "Z";
  return planes;
}

util::Result<std::vector<ValidationView>> render_views(const scene::Scene& scene,
                                                       const octree::Octree& octree,
                                                       const ViewOptions& options) {
  const double aspect = double(options.size.width) / double(options.size.height);
  const bool framings = options.camera == "ALL" && scene.cameras.empty();
  std::vector<scene::Camera> cameras;
  if (framings) {
    for (const Framing& candidate : kCandidates) {
      cameras.push_back(framing(scene.bounds, aspect, candidate));
    }
  } else if (options.camera == "ALL") {
    cameras = scene.cameras;
    make_names_unique(cameras);
  } else {
    util::Result<scene::Camera> camera = batch::choose_camera(options.camera, scene, aspect);
    if (!camera) return camera.error();
    cameras.push_back(std::move(*camera));
  }

  std::vector<ValidationView> views;
  for (scene::Camera& camera : cameras) {
    if (framings && views.size() == kFramings) break;
    util::Result<validation::Planes> planes = render_planes(scene, octree, camera, options);
    if (!planes) return planes.error();
    if (framings && coverage(*planes) < kLeastCoverage) continue;
    views.push_back({std::move(camera), std::move(*planes)});
  }
  if (views.empty()) {  // nothing to be seen from anywhere: say so once, and compare that
    util::Result<validation::Planes> planes =
        render_planes(scene, octree, cameras.front(), options);
    if (!planes) return planes.error();
    views.push_back({std::move(cameras.front()), std::move(*planes)});
  }
  return views;
}

}  // namespace octrace::app
