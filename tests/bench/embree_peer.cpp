#include "tests/bench/embree_peer.h"

#include <embree3/rtcore.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <chrono>
#include <cstring>
#include <string>

#include "tests/bench/clock.h"

namespace octrace::bench {

namespace {

constexpr std::size_t kPacket = 8;
constexpr std::size_t kStream = 256;
constexpr std::size_t kGrain = 4096;

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

RTCRayHit to_embree(const kernels::Ray& ray) {
  RTCRayHit r{};
  r.ray.org_x = ray.origin.x;
  r.ray.org_y = ray.origin.y;
  r.ray.org_z = ray.origin.z;
  r.ray.tnear = ray.tmin;
  r.ray.dir_x = ray.direction.x;
  r.ray.dir_y = ray.direction.y;
  r.ray.dir_z = ray.direction.z;
  r.ray.tfar = ray.tmax;
  r.ray.mask = 0xffffffffu;
  r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  r.hit.primID = RTC_INVALID_GEOMETRY_ID;
  return r;
}

}  // namespace

struct EmbreePeer::Impl {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;

  // Traces rays[first, last) in place.
  void trace(std::vector<RTCRayHit>& rays, std::size_t first, std::size_t last, bool any_hit,
             Interface interface, bool coherent) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags =
        coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    switch (interface) {
      case Interface::single:
        for (std::size_t i = first; i < last; ++i) {
          if (any_hit) {
            rtcOccluded1(scene, &context, &rays[i].ray);
          } else {
            rtcIntersect1(scene, &context, &rays[i]);
          }
        }
        return;
      case Interface::stream:
        for (std::size_t i = first; i < last; i += kStream) {
          const auto count = static_cast<unsigned>(std::min(kStream, last - i));
          if (any_hit) {
            rtcOccluded1M(scene, &context, &rays[i].ray, count, sizeof(RTCRayHit));
          } else {
            rtcIntersect1M(scene, &context, &rays[i], count, sizeof(RTCRayHit));
          }
        }
        return;
      case Interface::packet:
        for (std::size_t i = first; i < last; i += kPacket)
          trace_packet(rays, i, std::min(i + kPacket, last), any_hit, context);
        return;
    }
  }

  void trace_packet(std::vector<RTCRayHit>& rays, std::size_t first, std::size_t last, bool any_hit,
                    RTCIntersectContext& context) const {
    alignas(32) RTCRayHit8 packet;
    alignas(32) int valid[kPacket];
    for (std::size_t k = 0; k < kPacket; ++k) {
      valid[k] = first + k < last ? -1 : 0;
      const RTCRayHit& r = rays[std::min(first + k, last - 1)];
      packet.ray.org_x[k] = r.ray.org_x;
      packet.ray.org_y[k] = r.ray.org_y;
      packet.ray.org_z[k] = r.ray.org_z;
      packet.ray.dir_x[k] = r.ray.dir_x;
      packet.ray.dir_y[k] = r.ray.dir_y;
      packet.ray.dir_z[k] = r.ray.dir_z;
      packet.ray.tnear[k] = r.ray.tnear;
      packet.ray.tfar[k] = r.ray.tfar;
      packet.ray.time[k] = 0.0f;
      packet.ray.mask[k] = r.ray.mask;
      packet.ray.id[k] = 0;
      packet.ray.flags[k] = 0;
      packet.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
    }
    if (any_hit) {
      rtcOccluded8(valid, scene, &context, &packet.ray);
    } else {
      rtcIntersect8(valid, scene, &context, &packet);
    }
    for (std::size_t k = 0; k < last - first; ++k) {
      rays[first + k].ray.tfar = packet.ray.tfar[k];
      rays[first + k].hit.primID = packet.hit.primID[k];
      rays[first + k].hit.geomID = packet.hit.geomID[k];
    }
  }
};

bool EmbreePeer::available() { return true; }

std::string EmbreePeer::version() { return RTC_VERSION_STRING; }

EmbreePeer::EmbreePeer(const scene::Scene& scene, Quality quality, unsigned threads)
    : impl_(std::make_unique<Impl>()) {
  const std::string config = "threads=" + std::to_string(threads) + ",user_threads=0";
  impl_->device = rtcNewDevice(config.c_str());
  impl_->scene = rtcNewScene(impl_->device);
  const RTCBuildQuality build_quality =
      quality == Quality::high ? RTC_BUILD_QUALITY_HIGH : RTC_BUILD_QUALITY_MEDIUM;
  rtcSetSceneBuildQuality(impl_->scene, build_quality);
  RTCGeometry geometry = rtcNewGeometry(impl_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetGeometryBuildQuality(geometry, build_quality);
  void* vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                           sizeof(kernels::Vec3), scene.positions.size());
  std::memcpy(vertices, scene.positions.data(), scene.positions.size() * sizeof(kernels::Vec3));
  void* indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                          sizeof(kernels::Triangle), scene.triangles.size());
  std::memcpy(indices, scene.triangles.data(), scene.triangles.size() * sizeof(kernels::Triangle));
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(impl_->scene, geometry);
  rtcReleaseGeometry(geometry);
  const auto start = std::chrono::steady_clock::now();
  rtcCommitScene(impl_->scene);
  build_seconds_ = seconds_since(start);
}

EmbreePeer::~EmbreePeer() {
  rtcReleaseScene(impl_->scene);
  rtcReleaseDevice(impl_->device);
}

double EmbreePeer::trace(const std::vector<kernels::Ray>& rays, bool any_hit, bool coherent,
                         Interface interface, unsigned threads,
                         std::vector<kernels::Hit>* hits) const {
  std::vector<RTCRayHit> converted;
  converted.reserve(rays.size());
  for (const kernels::Ray& ray : rays) converted.push_back(to_embree(ray));
  const double start = seconds_now(threads);
  tbb::task_arena(static_cast<int>(threads)).execute([&] {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, rays.size(), kGrain),
                      [&](const tbb::blocked_range<std::size_t>& r) {
                        impl_->trace(converted, r.begin(), r.end(), any_hit, interface, coherent);
                      });
  });
  const double seconds = seconds_now(threads) - start;
  if (hits != nullptr) {
    hits->resize(rays.size());
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const RTCRayHit& r = converted[i];
      const bool hit = any_hit ? r.ray.tfar < 0.0f : r.hit.geomID != RTC_INVALID_GEOMETRY_ID;
      const std::uint32_t triangle = any_hit ? 0 : r.hit.primID;
      (*hits)[i] = {r.ray.tfar, 0.0f, 0.0f, hit ? triangle : kernels::kNone};
    }
  }
  return seconds;
}

}  // namespace octrace::bench
