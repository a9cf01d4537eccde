#include "backend/batch/next_frame.h"

#include "backend/scene/projection.h"

namespace octrace::batch {

render::NextFrame next_frame(const scene::Scene& scene, const scene::Camera& camera,
                             const scene::Moment& next, const ImageSize& size) {
  render::NextFrame frame{
      next.positions,
      scene::make_ray_camera(scene::camera_at(camera, scene, next), static_cast<int>(size.width),
                             static_cast<int>(size.height))};
  if (next.instancing) frame.instances = next.instancing->instances;
  return frame;
}

}  // namespace octrace::batch
