// Instances beside two oracles that share nothing with octrace but the file: every triangle of
// every instance in double precision (tests/support/gltf_reference.h), and Embree's own instances.
#include <embree3/rtcore.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <vector>

#include "backend/octree/octree.h"
#include "backend/render/renderer.h"
#include "backend/scene/flatten.h"
#include "tests/support/gltf_reference.h"
#include "tests/support/instanced_features.h"
#include "tests/support/instanced_scene.h"
#include "tests/support/intensity.h"
#include "tests/support/reference_image.h"

namespace octrace::tests {
namespace {

using render::Aov;
using scene::testing::GltfFile;

constexpr double kYfov = 0.5;
constexpr unsigned kNoInstance = RTC_INVALID_GEOMETRY_ID;

// Looks at what is shown without the floor, so that instances fill the view.
Matrix camera_of(const GltfReference::Frame& frame, std::size_t nodes) {
  std::vector<ReferenceTriangle> instances;
  for (const ReferenceTriangle& triangle : frame.triangles) {
    if (triangle.node >= nodes) instances.push_back(triangle);
  }
  return reference_framing(instances, kYfov);
}

render::Framebuffer shoot(const scene::Scene& scene, const Matrix& matrix, int width, int height,
                          bool alpha) {
  const auto tree = octree::build(scene, {});
  EXPECT_TRUE(tree);
  scene::Camera camera;
  camera.yfov = kYfov;
  for (int i = 0; i < 16; ++i) camera.matrix[i / 4][i % 4] = matrix[static_cast<std::size_t>(i)];
  const auto size = [](int pixels) { return static_cast<std::uint32_t>(pixels); };
  render::Framebuffer image(size(width), size(height), *render::parse_aovs("Z,mask,object_id,N"));
  render::Settings settings;
  settings.params.alpha = alpha ? 1 : 0;
  EXPECT_TRUE(render::make_cpu_renderer(scene, *tree)
                  ->render(scene::make_ray_camera(camera, width, height), settings, image));
  return image;
}

GltfReference reference_of(const GltfFile& file, const std::string& name) {
  const std::string path = testing::TempDir() + "octrace_instances_" + name + ".gltf";
  std::ofstream(path) << file.text();
  GltfReference reference(path);
  std::filesystem::remove(path);
  return reference;
}

struct InstancesBeside : testing::TestWithParam<InstanceShape> {};

TEST_P(InstancesBeside, EveryTriangleInDouble) {
  const GltfFile file = make_instanced_file(GetParam(), 60, seed());
  const GltfReference reference = reference_of(file, GetParam().name);
  const GltfReference::Frame frame = reference.frame(0, std::nullopt);
  ASSERT_EQ(frame.triangles.size(), 60u * 108u + 2u);
  const Matrix camera = camera_of(frame, file.root["nodes"].size());
  Tally tally;
  SCOPED_TRACE(seed());
  compare_with_reference(frame, camera, kYfov, shoot(file.scene(), camera, 56, 42, true), tally);
  EXPECT_GT(tally.hits, tally.pixels / 20);
  EXPECT_LT(tally.undecided, tally.pixels / 50);
}

// The nodes and their meshes as Embree has them: an instance is a scene of its own and a matrix.
class EmbreeInstances {
 public:
  using Corners = std::vector<std::array<Real3, 3>>;
  EmbreeInstances(const Corners& mesh, const std::vector<Matrix>& matrices, const Corners& plain) {
    device_ = rtcNewDevice("threads=1");
    mesh_ = new_scene();
    top_ = new_scene();
    attach(mesh_, new_triangles(mesh));
    rtcCommitScene(mesh_);
    for (const Matrix& matrix : matrices) {
      RTCGeometry instance = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
      rtcSetGeometryInstancedScene(instance, mesh_);
      float m[16];
      for (std::size_t i = 0; i < 16; ++i) m[i] = static_cast<float>(matrix[i]);
      rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, m);
      attach(top_, instance);
    }
    attach(top_, new_triangles(plain));
    rtcCommitScene(top_);
  }
  ~EmbreeInstances() {
    rtcReleaseScene(top_);
    rtcReleaseScene(mesh_);
    rtcReleaseDevice(device_);
  }
  struct Found {
    float depth;        // infinite: nothing is hit
    unsigned instance;  // RTC_INVALID_GEOMETRY_ID: none
  };
  Found closest(const ReferenceRay& ray) const {
    RTCRayHit r{};
    float* origin = &r.ray.org_x;
    float* direction = &r.ray.dir_x;
    for (std::size_t k = 0; k < 3; ++k) {
      origin[k] = static_cast<float>(ray.origin[k]);
      direction[k] = static_cast<float>(ray.direction[k]);
    }
    r.ray.tfar = std::numeric_limits<float>::infinity();
    r.ray.mask = 0xffffffffu;
    r.hit.geomID = r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(top_, &context, &r);
    const bool hit = r.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    return {hit ? r.ray.tfar : std::numeric_limits<float>::infinity(), r.hit.instID[0]};
  }

 private:
  RTCScene new_scene() const {
    RTCScene scene = rtcNewScene(device_);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    return scene;
  }
  RTCGeometry new_triangles(const Corners& corners) const {
    RTCGeometry triangles = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
        triangles, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 3 * corners.size()));
    auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
        triangles, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, corners.size()));
    for (std::size_t i = 0; i < 3 * corners.size(); ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        vertices[3 * i + k] = static_cast<float>(corners[i / 3][i % 3][k]);
      }
      indices[i] = static_cast<unsigned>(i);
    }
    rtcSetGeometryIntersectFilterFunction(triangles, cull);
    return triangles;
  }
  static void attach(RTCScene scene, RTCGeometry geometry) {
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
  }
  // In the mesh's own space, where a front stays one whatever the instance mirrors.
  static void cull(const RTCFilterFunctionNArguments* args) {
    const auto dot = RTCHitN_Ng_x(args->hit, args->N, 0) * RTCRayN_dir_x(args->ray, args->N, 0) +
                     RTCHitN_Ng_y(args->hit, args->N, 0) * RTCRayN_dir_y(args->ray, args->N, 0) +
                     RTCHitN_Ng_z(args->hit, args->N, 0) * RTCRayN_dir_z(args->ray, args->N, 0);
    if (dot > 0.0f) args->valid[0] = 0;
  }
  RTCDevice device_ = nullptr;
  RTCScene mesh_ = nullptr, top_ = nullptr;
};

// Embree keeps its matrices in float, so the mesh goes to it about its own centre.
TEST_P(InstancesBeside, Embree) {
  const InstanceShape& shape = GetParam();
  if (shape.flat) GTEST_SKIP() << "Embree inverts the matrix, and a scale of 0 has no inverse";
  const GltfFile file = make_instanced_file(shape, 60, seed() + 2);
  const GltfReference reference = reference_of(file, shape.name);
  const GltfReference::Frame frame = reference.frame(0, std::nullopt);
  std::vector<std::array<Real3, 3>> mesh;
  const std::vector<float> corners = bumpy_ball(shape.centre, false);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (i % 9 == 0) mesh.emplace_back();
    mesh.back()[i / 3 % 3][i % 3] = double{corners[i]} - double{shape.centre};
  }
  std::vector<Matrix> matrices = frame.instances;
  for (Matrix& m : matrices) {
    for (std::size_t r = 0; r < 3; ++r) m[12 + r] += shape.centre * (m[r] + m[4 + r] + m[8 + r]);
  }
  const std::size_t nodes = file.root["nodes"].size();
  const Matrix camera = camera_of(frame, nodes);
  constexpr int kWidth = 320, kHeight = 240;
  const render::Framebuffer image = shoot(file.scene(), camera, kWidth, kHeight, true);
  std::vector<std::array<Real3, 3>> plain;
  std::uint32_t floor = 0;
  for (const ReferenceTriangle& triangle : frame.triangles) {
    if (triangle.node >= nodes) continue;
    plain.push_back(triangle.corners);
    floor = triangle.node;
  }
  const EmbreeInstances embree(mesh, matrices, plain);
  std::size_t differing = 0, instanced = 0;
  std::vector<double> errors;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const ReferenceRay ray = reference_ray(camera, kYfov, kWidth, kHeight, x + 0.5, y + 0.5);
      const auto found = embree.closest(ray);
      const auto pixel = static_cast<std::size_t>(y * kWidth + x);
      const bool hit = std::isfinite(found.depth), of_floor = found.instance == kNoInstance;
      const std::size_t id = !hit ? 0 : 1 + (of_floor ? floor : nodes + found.instance);
      if (image.uints(Aov::object_id)[pixel] != id) {
        ++differing;  // at an edge or where two surfaces cross, or it is Embree that errs
        const auto grown = reference_cast(frame.triangles, ray, 1e-5);
        const auto shrunk = reference_cast(frame.triangles, ray, -1e-5);
        if (grown.has_value() == shrunk.has_value() && (!grown || grown->node == shrunk->node)) {
          EXPECT_EQ(image.uints(Aov::object_id)[pixel], grown ? grown->node + 1 : 0);
        }
      } else if (hit) {
        instanced += !of_floor;
        errors.push_back(std::abs(double{image.floats(Aov::depth)[pixel]} / found.depth - 1.0));
      }
    }
  }
  ASSERT_GT(instanced, std::size_t{kWidth * kHeight / 20});
  std::sort(errors.begin(), errors.end());
  EXPECT_LE(differing, std::size_t{kWidth * kHeight / 10000}) << "seed " << seed();
  EXPECT_LT(errors[errors.size() / 2], 2e-7);
  EXPECT_LT(errors[errors.size() * 99 / 100], 1e-6);
}

std::string shape_name(const testing::TestParamInfo<InstanceShape>& info) {
  return info.param.name;
}
INSTANTIATE_TEST_SUITE_P(Shapes, InstancesBeside, testing::ValuesIn(instance_shapes()), shape_name);

}  // namespace
}  // namespace octrace::tests
