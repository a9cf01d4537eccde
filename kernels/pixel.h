// What one pixel does: fill the geometry AOVs from one exact ray, or beauty from many. The two are
// separate, so that depth costs no shading and beauty's sampling never touches depth.
#pragma once

#include "kernels/aov.h"
#include "kernels/camera.h"
#include "kernels/motion.h"
#include "kernels/path.h"

namespace octrace::kernels {

OCTRACE_HD inline void store(float* plane, std::uint64_t pixel, const Vec2& value) {
  plane[2 * pixel] = value.x;
  plane[2 * pixel + 1] = value.y;
}
OCTRACE_HD inline void store(float* plane, std::uint64_t pixel, const Vec3& value) {
  plane[3 * pixel] = value.x;
  plane[3 * pixel + 1] = value.y;
  plane[3 * pixel + 2] = value.z;
}
OCTRACE_HD inline void store(float* plane, std::uint64_t pixel, const Vec4& value) {
  plane[4 * pixel] = value.x;
  plane[4 * pixel + 1] = value.y;
  plane[4 * pixel + 2] = value.z;
  plane[4 * pixel + 3] = value.w;
}

// `to`: a FramebufferView or PlanesOf.
template <class Planes>
OCTRACE_HD inline void store_background(const Planes& to, std::uint64_t pixel) {
  constexpr float kFar = std::numeric_limits<float>::infinity();
  if (float* plane = to.floats(Aov::depth)) plane[pixel] = kFar;
  if (float* plane = to.floats(Aov::distance)) plane[pixel] = kFar;
  if (float* plane = to.floats(Aov::mask)) plane[pixel] = 0.0f;
  if (float* plane = to.floats(Aov::normal)) store(plane, pixel, Vec3(0.0f));
  if (float* plane = to.floats(Aov::geometric_normal)) store(plane, pixel, Vec3(0.0f));
  if (float* plane = to.floats(Aov::position)) store(plane, pixel, Vec3(0.0f));
  if (float* plane = to.floats(Aov::albedo)) store(plane, pixel, Vec3(0.0f));
  if (float* plane = to.floats(Aov::uv)) store(plane, pixel, Vec2(0.0f));
  if (float* plane = to.floats(Aov::barycentric)) store(plane, pixel, Vec2(0.0f));
  if (std::uint32_t* plane = to.uints(Aov::object_id)) plane[pixel] = 0;
  if (std::uint32_t* plane = to.uints(Aov::material_id)) plane[pixel] = 0;
  if (std::uint32_t* plane = to.uints(Aov::primitive_id)) plane[pixel] = 0;
}

template <class Scene, class Planes>
OCTRACE_HD inline void store_hit(const Scene& scene, const Ray& ray, const HitOf<Scene>& hit,
                                 const Planes& to, std::uint64_t pixel) {
  const SceneView& arrays = arrays_of(scene, hit);
  const Geometry& geometry = arrays.geometries[arrays.triangle_geometry[hit.triangle]];
  if (float* plane = to.floats(Aov::depth)) plane[pixel] = hit.t;
  if (float* plane = to.floats(Aov::distance)) plane[pixel] = hit.t * length(ray.direction);
  if (float* plane = to.floats(Aov::mask)) plane[pixel] = 1.0f;
  if (float* plane = to.floats(Aov::barycentric)) store(plane, pixel, Vec2(hit.u, hit.v));
  if (std::uint32_t* plane = to.uints(Aov::object_id)) plane[pixel] = object_of(scene, hit) + 1;
  if (std::uint32_t* plane = to.uints(Aov::material_id)) plane[pixel] = geometry.material + 1;
  if (std::uint32_t* plane = to.uints(Aov::primitive_id)) plane[pixel] = hit.triangle + 1;

  float* normal = to.floats(Aov::normal);
  float* geometric_normal = to.floats(Aov::geometric_normal);
  float* position = to.floats(Aov::position);
  float* albedo = to.floats(Aov::albedo);
  float* uv = to.floats(Aov::uv);
  if (!normal && !geometric_normal && !position && !albedo && !uv) return;
  const auto surface = make_surface(scene, ray, hit);
  if (geometric_normal) store(geometric_normal, pixel, surface.geometric_normal);
  if (normal) store(normal, pixel, shading_normal(arrays, surface));
  if (position) store(position, pixel, surface.position);
  if (albedo) {
    const Vec4 color = base_color(arrays, surface);
    store(albedo, pixel, Vec3(color.x, color.y, color.z));
  }
  if (uv) {
    const bool has_uv = geometry.uv0 != kNone;
    store(uv, pixel,
          has_uv ? interpolate(arrays.uvs, geometry.uv0, geometry, surface.point) : Vec2(0.0f));
  }
}

// All planes of `to` but beauty, from what the ray through the pixel's centre found. `motion`:
// NoMotion or MotionPlane.
template <class Scene, class Planes, class Motion = NoMotion>
OCTRACE_HD inline void store_geometry(const Scene& scene, const Ray& ray, const HitOf<Scene>& hit,
                                      const Planes& to, std::uint32_t x, std::uint32_t y,
                                      const Motion& motion = {}) {
  const std::uint64_t pixel = to.pixel(x, y);
  if (hit.valid()) {
    store_hit(scene, ray, hit, to, pixel);
  } else {
    store_background(to, pixel);
  }
  motion(scene, hit, to, pixel);
}

// The same, tracing the ray. Surfaces with alpha mode BLEND count as solid, because a pixel has one
// depth.
template <class Scene, class Tracer, class Motion = NoMotion>
OCTRACE_HD TraceStatus trace_geometry(const Scene& scene, const RayCamera& camera,
                                      const RenderParams& params, const FramebufferView& to,
                                      std::uint32_t x, std::uint32_t y, const Tracer& tracer,
                                      const Motion& motion = {}) {
  const Ray ray = camera_ray(camera, static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
  HitOf<Scene> hit;
  const TraceStatus status = tracer.closest(scene, params, ray, &hit);
  if (status == TraceStatus::ok) store_geometry(scene, ray, hit, to, x, y, motion);
  return status;
}

// A box filter of one pixel's width over params.spp stratified positions; one sample goes through
// the centre.
template <class Scene, class Tracer>
OCTRACE_HD TraceStatus trace_beauty(const Scene& scene, const RayCamera& camera,
                                    const RenderParams& params, const FramebufferView& to,
                                    std::uint32_t x, std::uint32_t y, const Tracer& tracer,
                                    RayCounts* counts) {
  Vec4 sum(0.0f);
  for (std::uint32_t i = 0; i < params.spp; ++i) {
    const Sampler sampler = make_sampler(x, y, params.seed, i, params.spp);
    const Vec2 place = params.spp == 1 ? Vec2(0.5f) : sampler.get2(0);
    const Ray ray =
        camera_ray(camera, static_cast<float>(x) + place.x, static_cast<float>(y) + place.y);
    Vec4 color;
    const TraceStatus status = trace_path(scene, params, ray, sampler, tracer, counts, &color);
    if (status != TraceStatus::ok) return status;
    sum += color;
  }
  store(to.floats(Aov::beauty), to.pixel(x, y), sum / static_cast<float>(params.spp));
  return TraceStatus::ok;
}

}  // namespace octrace::kernels
