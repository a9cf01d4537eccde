#include <gtest/gtest.h>

#include <filesystem>
#include <glm/gtc/matrix_transform.hpp>
#include <set>

#include "backend/gltf/document.h"
#include "backend/image/image.h"
#include "backend/scene/flatten.h"
#include "exporters/povray/povray.h"
#include "tests/unit/exporters_programs.h"
#include "tests/unit/exporters_scene.h"

namespace octrace::test {
namespace {

// POV-Ray keeps corners as floats at radius 10: half a unit in the last place, seen from a tenth of
// that and at a slant, plus the depth's own half step.
constexpr double kDepthError = 5e-6;

class Povray : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!installed("povray")) GTEST_SKIP() << "povray is not installed";
  }

  void expect_agreement(const scene::Scene& scene, const scene::Camera& camera, int slack = 2,
                        bool cull = true, bool alpha = true) {
    exporters::PovrayOptions options;
    options.width = width_;
    options.height = height_;
    options.cull = cull;
    options.alpha = alpha;
    const auto expected = cast_rays(scene, camera, {options.width, options.height, cull, alpha});
    const auto actual = through_povray(scene, camera, options, folder_.path());
    expect_same_sight(expected, actual, options.width, slack, kDepthError);
    for (const Sight& sight : expected) seen_.insert(sight.object);
  }

  TemporaryFolder folder_;
  int width_ = 160, height_ = 120;
  std::set<std::uint32_t> seen_;
};

TEST_F(Povray, ShowsWhatARayCasterShows) {
  const scene::Scene scene = varied_scene();
  expect_agreement(scene, look_at({0.3, 0.4, 9.5}, {0, 0, 0}, 0.75));
  // The scene is worth looking at only if every kind of surface is in the picture.
  for (const std::uint32_t object : {1u, 2u, 3u, 5u, 7u, 8u, 9u, 10u, 11u, 12u}) {
    EXPECT_TRUE(seen_.contains(object)) << "object " << object;
  }
  EXPECT_FALSE(seen_.contains(4)) << "a single-sided card seen from behind";
  EXPECT_FALSE(seen_.contains(6)) << "its coincident back";
}

TEST_F(Povray, ShowsBackFacesAndIgnoresAlphaWhenTold) {
  const scene::Scene scene = varied_scene();
  expect_agreement(scene, look_at({0.3, 0.4, 9.5}, {0, 0, 0}, 0.75), 2, true, false);
  // Without culling the coincident sheets fight for their pixels: they must not be in the way.
  scene::Scene plain;
  add_material(plain, {});
  Part ball = sphere("inside out", {0, 0, 0}, 1.0f);
  flip(ball);
  add_part(plain, ball);
  add_part(plain, box("box", {0, 0, -2}, {2.0f, 0.4f, 0.4f}));
  finish(plain);
  expect_agreement(plain, look_at({2, 1, 4}, {0, 0, 0}, 0.6), 2, false);
}

TEST_F(Povray, LooksFromInsideAndBehind) {
  const scene::Scene scene = varied_scene();
  expect_agreement(scene, look_at({0.0, 0.5, 4.0}, {0.3, 0.2, -3.0}, 1.2));
  expect_agreement(scene, look_at({4.0, 2.5, -5.5}, {0, 0, 1}, 1.0));
}

TEST_F(Povray, FollowsOrthographicCameras) {
  scene::Camera camera = look_at({3, 2.5, 8}, {0, 0, 0}, 0.5);
  camera.type = scene::CameraType::orthographic;
  camera.xmag = 99.0;  // only its sign matters: the image's own aspect counts
  camera.ymag = 3.1;
  expect_agreement(varied_scene(), camera);
  camera.xmag = -1.0;
  expect_agreement(varied_scene(), camera);
  camera.ymag = -3.1;
  expect_agreement(varied_scene(), camera);
}

TEST_F(Povray, FollowsPinholeCameras) {
  scene::Camera camera = look_at({0.5, 0.4, 9.0}, {0, 0, 0}, 0.5);
  camera.type = scene::CameraType::pinhole;
  camera.width = 320;
  camera.height = 200;
  camera.fx = 290;
  camera.fy = 250;
  camera.cx = 141.5;
  camera.cy = 117.25;
  expect_agreement(varied_scene(), camera);
}

TEST_F(Povray, FollowsRolledScaledAndMirroredCameras) {
  scene::Camera camera = look_at({1, 0.4, 9.0}, {0, 0, 0}, 0.8);
  camera.matrix = glm::rotate(camera.matrix, 0.6, glm::dvec3(0, 0, 1));
  camera.matrix = glm::scale(camera.matrix, glm::dvec3(3.0, 3.0, 3.0));
  expect_agreement(varied_scene(), camera);
  camera.matrix = glm::scale(camera.matrix, glm::dvec3(-1.0, 1.0, 1.0));
  expect_agreement(varied_scene(), camera);
}

TEST_F(Povray, ClipsAtBothPlanes) {
  scene::Camera camera = look_at({0.3, 0.4, 9.5}, {0, 0, 0}, 0.75);
  camera.znear = 9.0;
  camera.zfar = 11.5;
  expect_agreement(varied_scene(), camera);
  EXPECT_TRUE(seen_.contains(0)) << "the room's far wall lies beyond";
}

TEST_F(Povray, WorksAtAnyScaleAndPlace) {
  for (const double scale : {1e-4, 1e4}) {
    for (const double offset : {0.0, 50.0}) {
      scene::Scene scene = varied_scene();
      for (auto& p : scene.positions) {
        p = kernels::Vec3((glm::dvec3(p) + offset) * scale);
      }
      finish(scene);
      scene::Camera camera = look_at((glm::dvec3(0.3, 0.4, 9.5) + offset) * scale,
                                     (glm::dvec3(0.0) + offset) * scale, 0.75);
      SCOPED_TRACE(scale);
      // The coincident sheets no longer share a depth to the last bit once they are moved.
      expect_agreement(scene, camera, 3);
    }
  }
}

TEST_F(Povray, EncodesDepthAndIdsExactly) {
  // A slope through the whole range, seen squarely: depth is known in closed form.
  scene::Scene scene;
  kernels::Material both;
  both.double_sided = 1;
  add_material(scene, both);
  scene.object_names.assign(54320, "");
  add_part(
      scene,
      {"slope", 0, {{-4, -4, 0}, {4, -4, -8}, {4, 4, -8}, {-4, 4, 0}}, {{0, 1, 2}, {0, 2, 3}}});
  finish(scene);
  scene::Camera camera;
  camera.type = scene::CameraType::orthographic;
  camera.ymag = 3.0;
  camera.matrix[3] = {0, 0, 1, 1};
  exporters::PovrayOptions options;
  options.width = 400;
  options.height = 300;
  const auto sights = through_povray(scene, camera, options, folder_.path());
  ASSERT_EQ(sights.size(), 400u * 300u);
  for (std::size_t i = 0; i < sights.size(); ++i) {
    ASSERT_EQ(sights[i].object, 54321u);
    const double x = (static_cast<double>(i % 400) + 0.5) / 400.0 * 8.0 - 4.0;
    ASSERT_NEAR(sights[i].depth, 1.0 + (x + 4.0), 2e-8) << "pixel " << i;
  }
}

TEST_F(Povray, RefusesMoreObjectsThanIdsInTheImage) {
  scene::Scene scene = varied_scene();
  scene.object_names.resize(65536);
  const auto file = exporters::write_povray(scene, {}, {}, folder_.file("many.pov"));
  ASSERT_FALSE(file);
  EXPECT_EQ(file.error().exit, util::Exit::unsupported);
}

TEST_F(Povray, RendersAnEmptyScene) {
  scene::Scene scene;
  add_material(scene, {});
  expect_agreement(scene, look_at({0, 0, 3}, {0, 0, 0}, 0.7), 0);
}

TEST_F(Povray, HostileNamesStayNames) {
  scene::Scene scene = varied_scene();
  const char* hostile[] = {"*/ #error \"in\" /*",
                           "a\n#error \"line\"\n",
                           "\"}}",
                           "sphere",
                           "\xff\xfe\x01",
                           "x\\",
                           "#include \"/etc/passwd\"",
                           "naïve ☃"};
  for (std::size_t i = 0; i < scene.object_names.size(); ++i)
    scene.object_names[i] = hostile[i % 8];
  for (std::size_t i = 0; i < scene.material_names.size(); ++i)
    scene.material_names[i] = hostile[i % 8];
  expect_agreement(scene, look_at({0.3, 0.4, 9.5}, {0, 0, 0}, 0.75));
}

TEST_F(Povray, SceneModeShowsLightsColoursAndTextures) {
  scene::Scene scene = varied_scene();
  scene.lights.push_back({kernels::LightType::point, {0, 2, 4}, {}, {60, 60, 60}, INFINITY, 0, 0});
  scene.materials[0].base_color = {0.9f, 0.05f, 0.05f, 1.0f};
  scene.materials[0].metallic = 0.0f;
  exporters::PovrayOptions options;
  options.mode = exporters::PovrayMode::scene;
  options.width = 160;
  options.height = 120;
  const auto file = exporters::write_povray(scene, look_at({0.3, 0.4, 9.5}, {0, 0, 0}, 0.75),
                                            options, folder_.file("look.pov"));
  ASSERT_TRUE(file) << file.error().to_string();
  ASSERT_EQ(run_in(folder_.path(), "povray", file->arguments), 0)
      << read_text(folder_.file("povray.log"));
  const auto image = image::read(folder_.file(file->image), {});
  ASSERT_TRUE(image) << image.error().to_string();
  // The ball is red, its lit side brighter than its rim.
  const auto pixel = [&](int x, int y, const char* channel) {
    return image->find(channel)->floats[static_cast<std::size_t>(y * 160 + x)];
  };
  EXPECT_GT(pixel(48, 48, "R"), 2.0f * pixel(48, 48, "G"));
  EXPECT_GT(pixel(52, 44, "R"), 1.2f * pixel(35, 62, "R"));
}

util::Result<scene::DecodedImage> decode(std::span<const std::uint8_t> bytes,
                                         const std::string& mime, const util::Limits& limits) {
  auto decoded = image::decode(bytes, mime, limits);
  if (!decoded) return decoded.error();
  return scene::DecodedImage{decoded->width, decoded->height, std::move(decoded->texels)};
}

TEST_F(Povray, ShowsRealScenesAsARayCasterDoes) {
  const std::filesystem::path shared = std::filesystem::path(OCTRACE_SHARED_SCENES) / "valid";
  if (!std::filesystem::exists(shared)) GTEST_SKIP() << shared << " is not there";
  int scenes = 0;
  width_ = 64;
  height_ = 48;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(shared)) {
    const std::string extension = entry.path().extension().string();
    if (extension != ".gltf" && extension != ".glb") continue;
    SCOPED_TRACE(entry.path().filename());
    const auto document = gltf::load(entry.path().string(), {});
    ASSERT_TRUE(document) << document.error().to_string();
    scene::FlattenOptions options;
    options.need_textures = false;
    options.decode = decode;
    const auto scene = scene::flatten(*document, options);
    ASSERT_TRUE(scene) << scene.error().to_string();
    expect_agreement(*scene, scene::frame_bounds(scene->bounds, 160.0 / 120.0));
    ++scenes;
  }
  EXPECT_GT(scenes, 20);
}

}  // namespace
}  // namespace octrace::test
