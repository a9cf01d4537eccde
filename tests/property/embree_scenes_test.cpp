// Every real scene at 640x480 beside Embree, which shares nothing with octrace but the flattened
// triangles: the rays are projected here, in double, from the camera's own numbers.
#include <embree3/rtcore.h>
#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "backend/render/renderer.h"
#include "tests/property/oracle_scenes.h"

namespace octrace::tests {
namespace {

using render::Aov;

class EmbreeScene {
 public:
  explicit EmbreeScene(const scene::Scene& scene) : scene_(scene) {
    device_ = rtcNewDevice("threads=1");
    embree_ = rtcNewScene(device_);
    rtcSetSceneFlags(embree_, RTC_SCENE_FLAG_ROBUST);
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    void* vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                             12, scene.positions.size());
    std::memcpy(vertices, scene.positions.data(), scene.positions.size() * 12);
    void* indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                            12, scene.triangles.size());
    std::memcpy(indices, scene.triangles.data(), scene.triangles.size() * 12);
    rtcSetGeometryUserData(geometry, this);
    rtcSetGeometryIntersectFilterFunction(geometry, cull);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(embree_, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(embree_);
  }
  ~EmbreeScene() {
    rtcReleaseScene(embree_);
    rtcReleaseDevice(device_);
  }

  float depth(const glm::dvec3& origin, const glm::dvec3& direction, double znear,
              double zfar) const {
    RTCRayHit r{};
    r.ray.org_x = static_cast<float>(origin.x);
    r.ray.org_y = static_cast<float>(origin.y);
    r.ray.org_z = static_cast<float>(origin.z);
    r.ray.dir_x = static_cast<float>(direction.x);
    r.ray.dir_y = static_cast<float>(direction.y);
    r.ray.dir_z = static_cast<float>(direction.z);
    r.ray.tnear = static_cast<float>(znear);
    r.ray.tfar = static_cast<float>(zfar);
    r.ray.mask = 0xffffffffu;
    r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(embree_, &context, &r);
    return r.hit.geomID == RTC_INVALID_GEOMETRY_ID ? std::numeric_limits<float>::infinity()
                                                   : r.ray.tfar;
  }

 private:
  // Refuses the backs of single-sided triangles.
  static void cull(const RTCFilterFunctionNArguments* args) {
    const auto& self = *static_cast<const EmbreeScene*>(args->geometryUserPtr);
    const auto primitive = RTCHitN_primID(args->hit, args->N, 0);
    const kernels::Geometry& geometry =
        self.scene_.geometries[self.scene_.triangle_geometry[primitive]];
    if (self.scene_.materials[geometry.material].double_sided) return;
    const kernels::Triangle& t = self.scene_.triangles[primitive];
    const glm::dvec3 a(self.scene_.positions[t.a]), b(self.scene_.positions[t.b]),
        c(self.scene_.positions[t.c]);
    const glm::dvec3 n = glm::cross(b - a, c - a);
    const double facing = n.x * RTCRayN_dir_x(args->ray, args->N, 0) +
                          n.y * RTCRayN_dir_y(args->ray, args->N, 0) +
                          n.z * RTCRayN_dir_z(args->ray, args->N, 0);
    if (facing > 0.0) args->valid[0] = 0;
  }

  const scene::Scene& scene_;
  RTCDevice device_ = nullptr;
  RTCScene embree_ = nullptr;
};

// Ray through (x + 0.5, y + 0.5), scaled so that t is the planar depth, from the glTF definition of
// the two cameras.
void project(const scene::Camera& camera, int x, int y, int width, int height, glm::dvec3* origin,
             glm::dvec3* direction) {
  const glm::dvec3 right = glm::normalize(glm::dvec3(camera.matrix[0]));
  const glm::dvec3 back = glm::normalize(glm::dvec3(camera.matrix[2]));
  const glm::dvec3 up = glm::normalize(glm::dvec3(camera.matrix[1]));
  const double sx = ((x + 0.5) / width * 2.0 - 1.0) * width / height;
  const double sy = 1.0 - (y + 0.5) / height * 2.0;
  *origin = glm::dvec3(camera.matrix[3]);
  if (camera.type == scene::CameraType::orthographic) {
    *origin += right * (sx * camera.ymag) + up * (sy * camera.ymag);
    *direction = -back;
  } else {
    const double k = std::tan(camera.yfov / 2.0);
    *direction = right * (sx * k) + up * (sy * k) - back;
  }
}

struct EmbreeOracle : testing::TestWithParam<std::string> {};

TEST_P(EmbreeOracle, SeesTheSameSilhouetteAndDepth) {
  constexpr int kWidth = 640, kHeight = 480;
  const auto loaded = load_oracle_scene(GetParam(), double(kWidth) / kHeight);
  ASSERT_TRUE(loaded);
  render::AovSet aovs;
  aovs.set(static_cast<std::size_t>(Aov::depth));
  render::Framebuffer image(kWidth, kHeight, aovs);
  render::Settings settings;
  settings.params.alpha = 0;  // Embree knows no textures
  ASSERT_TRUE(
      render::make_cpu_renderer(loaded->scene, loaded->octree)
          ->render(scene::make_ray_camera(loaded->camera, kWidth, kHeight), settings, image));
  const EmbreeScene embree(loaded->scene);
  std::vector<float> expected(kWidth * kHeight);
  tbb::parallel_for(0, kHeight, [&](int y) {
    for (int x = 0; x < kWidth; ++x) {
      glm::dvec3 origin, direction;
      project(loaded->camera, x, y, kWidth, kHeight, &origin, &direction);
      expected[y * kWidth + x] =
          embree.depth(origin, direction, loaded->camera.znear, loaded->camera.zfar);
    }
  });
  int differing = 0, covered = 0;
  std::vector<double> errors;
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const float z = image.floats(Aov::depth)[i];
    covered += std::isfinite(z);
    if (std::isfinite(z) != std::isfinite(expected[i])) {
      ++differing;
    } else if (std::isfinite(z)) {
      errors.push_back(std::abs(double(z) - expected[i]) / expected[i]);
    }
  }
  EXPECT_LE(differing, 2) << "of " << covered << " covered pixels";
  if (errors.empty()) return;  // a scene of points and lines only
  std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
  EXPECT_LT(errors[errors.size() / 2], 1e-6);
}

std::string file_name(const testing::TestParamInfo<std::string>& info) {
  std::string name = info.param.substr(info.param.find_last_of('/') + 1);
  for (char& c : name) {
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  }
  return name;
}
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(EmbreeOracle);
INSTANTIATE_TEST_SUITE_P(Valid, EmbreeOracle, testing::ValuesIn(oracle_scene_files()), file_name);

}  // namespace
}  // namespace octrace::tests
