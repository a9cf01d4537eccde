// Depth, mask, object and normal of animated scenes against an evaluation of its own
// (tests/support/gltf_reference.h), at key times and densely between them, going from time to time
// as a batch does.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>

#include "backend/octree/update.h"
#include "backend/render/renderer.h"
#include "backend/scene/animator.h"
#include "backend/scene/instances.h"
#include "tests/property/animated_scenes.h"
#include "tests/property/oracle_scenes.h"
#include "tests/support/gltf_reference.h"
#include "tests/support/intensity.h"
#include "tests/support/reference_image.h"

namespace octrace::tests {
namespace {

using render::Aov;

constexpr int kWidth = 56, kHeight = 42;

scene::FlattenOptions white_textures() {
  scene::FlattenOptions options;
  options.decode = [](std::span<const std::uint8_t>, const std::string&, const util::Limits&) {
    return util::Result<scene::DecodedImage>(scene::DecodedImage{1, 1, {0xffffffffu}});
  };
  return options;
}

bool is_animated(const std::string& path) {
  return GltfReference(path).file().contains("animations");
}

// The shared animated files, and the project's own written to a temporary folder.
std::vector<std::string> scene_names() {
  std::vector<std::string> names;
  for (const AnimatedScene& scene : animated_scenes()) names.push_back(scene.name);
  for (const std::string& file : oracle_scene_files()) {
    if (is_animated(file)) names.push_back(file);
  }
  return names;
}

class AnimatedScenes : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    path_ = GetParam();
    if (path_.find('/') != std::string::npos) return;
    for (const AnimatedScene& scene : animated_scenes()) {
      if (scene.name != GetParam()) continue;
      const auto* test = testing::UnitTest::GetInstance()->current_test_info();
      path_ = testing::TempDir() + "octrace_" + scene.name + "_" + std::to_string(test->line()) +
              ".gltf";
      std::ofstream(path_) << scene.file.text();
      temporary_ = true;
    }
  }
  void TearDown() override {
    if (temporary_) std::filesystem::remove(path_);
  }

  std::unique_ptr<scene::Animator> open(int animation, scene::Time time,
                                        scene::Scene& scene) const {
    auto document = gltf::load(path_, {});
    if (!document) {
      ADD_FAILURE() << document.error().to_string();
      return nullptr;
    }
    auto animator = scene::Animator::open(std::move(*document), white_textures(),
                                          std::to_string(animation), time, scene);
    if (!animator) {
      ADD_FAILURE() << animator.error().to_string();
      return nullptr;
    }
    return std::move(*animator);
  }

  std::string path_;
  bool temporary_ = false;
};

// Up to `most` key times and the moments between them, and one on each side, in no order.
std::vector<double> moments(const std::vector<double>& keys, std::size_t most) {
  std::vector<double> times{keys.front() - 0.25, keys.back() + 0.25};
  const std::size_t step = std::max<std::size_t>(1, keys.size() / most);
  for (std::size_t i = 0; i < keys.size(); i += step) times.push_back(keys[i]);
  times.push_back(keys.back());
  constexpr double kGolden = 0.6180339887498949;
  for (std::size_t i = 1; i <= most; ++i) {
    const double share =
        static_cast<double>(i) * kGolden - std::floor(static_cast<double>(i) * kGolden);
    times.push_back(keys.front() + share * (keys.back() - keys.front()));
  }
  std::mt19937_64 random(seed());
  std::shuffle(times.begin(), times.end(), random);
  return times;
}

struct View {
  Matrix matrix;
  double yfov;
  scene::Camera camera;
};

// The scene's own camera where it has one, as each side sees it; else the same framing for both.
View view_of(const GltfReference& reference, const GltfReference::Frame& frame,
             const scene::Scene& scene) {
  const auto& nodes = reference.file()["nodes"];
  for (std::size_t n = 0; n < nodes.size() && !scene.cameras.empty(); ++n) {
    if (!nodes[n].contains("camera")) continue;
    const auto& camera = reference.file()["cameras"][nodes[n]["camera"].get<std::size_t>()];
    return {frame.worlds[n], camera["perspective"]["yfov"], scene.cameras[0]};
  }
  View view{reference_framing(frame.triangles, 0.7), 0.7, {}};
  view.camera.yfov = view.yfov;
  for (int i = 0; i < 16; ++i) view.camera.matrix[i / 4][i % 4] = view.matrix[i];
  return view;
}

TEST_P(AnimatedScenes, LookAsASecondEvaluationSays) {
  const GltfReference reference(path_);
  const auto count = static_cast<int>(reference.file()["animations"].size());
  render::AovSet aovs = *render::parse_aovs("Z,mask,object_id,N");
  for (int animation = 0; animation < count; ++animation) {
    scene::Scene scene;
    const auto animator = open(animation, std::nullopt, scene);
    ASSERT_TRUE(animator);
    util::Result<octree::Octree> octree = octree::build(scene, {});
    ASSERT_TRUE(octree);
    octree::Upkeep upkeep;
    const auto renderer = render::make_cpu_renderer(scene, *octree);
    Tally tally;
    const auto times = moments(reference.key_times(animation), scaled(12));
    for (const double time : times) {
      SCOPED_TRACE("animation " + std::to_string(animation) + " at " + std::to_string(time) +
                   " s, seed " + std::to_string(seed()));
      const auto changes = animator->move_to(time, scene);
      ASSERT_TRUE(changes);
      if (changes->geometry()) {
        ASSERT_TRUE(octree::update(scene, {}, {}, *octree, upkeep));
      }
      ASSERT_TRUE(octree::verify(*octree, scene));
      ASSERT_TRUE(renderer->refresh(*changes));
      const GltfReference::Frame frame = reference.frame(animation, time);
      const View view = view_of(reference, frame, scene);
      render::Framebuffer image(kWidth, kHeight, aovs);
      ASSERT_TRUE(
          renderer->render(scene::make_ray_camera(view.camera, kWidth, kHeight), {}, image));
      compare_with_reference(frame, view.matrix, view.yfov, image, tally);
      if (HasFatalFailure()) return;
    }
    EXPECT_GT(tally.hits, tally.pixels / 50);
    EXPECT_LT(tally.undecided, tally.pixels / 50);
  }
}

// The same bits on the way from moment to moment as in a fresh load of each, in every plane.
TEST_P(AnimatedScenes, AreTheSameBitsFromMomentToMoment) {
  const GltfReference reference(path_);
  scene::Scene scene;
  const auto animator = open(0, std::nullopt, scene);
  ASSERT_TRUE(animator);
  util::Result<octree::Octree> octree = octree::build(scene, {});
  ASSERT_TRUE(octree);
  octree::Upkeep upkeep;
  const auto renderer = render::make_cpu_renderer(scene, *octree);
  render::AovSet aovs;
  aovs.set();
  for (const double time : moments(reference.key_times(0), scaled(4))) {
    SCOPED_TRACE(time);
    const auto changes = animator->move_to(time, scene);
    ASSERT_TRUE(changes);
    if (changes->geometry()) {
      ASSERT_TRUE(octree::update(scene, {}, {}, *octree, upkeep));
    }
    ASSERT_TRUE(renderer->refresh(*changes));
    scene::Scene fresh;
    const auto other = open(0, time, fresh);
    ASSERT_TRUE(other);
    util::Result<octree::Octree> built = octree::build(fresh, {});
    ASSERT_TRUE(built);
    const auto fresh_renderer = render::make_cpu_renderer(fresh, *built);

    const auto shoot = [&](const scene::Animator& from, const scene::Scene& of,
                           render::Renderer& by) {
      const scene::Camera camera =
          of.cameras.empty() ? scene::frame_bounds(of.bounds, 4.0 / 3.0) : of.cameras[0];
      const auto next = from.at(time + 0.1, of);
      EXPECT_TRUE(next);
      render::Settings settings;
      settings.params.spp = 2;
      settings.next = {next->positions,
                       scene::make_ray_camera(scene::camera_at(camera, of, *next), 40, 30)};
      if (next->instancing) settings.next->instances = next->instancing->instances;
      render::Framebuffer image(40, 30, aovs);
      EXPECT_TRUE(by.render(scene::make_ray_camera(camera, 40, 30), settings, image));
      return image;
    };
    const render::Framebuffer a = shoot(*animator, scene, *renderer);
    const render::Framebuffer b = shoot(*other, fresh, *fresh_renderer);
    for (const render::AovInfo& info : render::aov_table()) {
      const auto x =
          info.uint32 ? std::as_bytes(a.uints(info.aov)) : std::as_bytes(a.floats(info.aov));
      const auto y =
          info.uint32 ? std::as_bytes(b.uints(info.aov)) : std::as_bytes(b.floats(info.aov));
      ASSERT_EQ(x.size(), y.size());
      EXPECT_EQ(0, std::memcmp(x.data(), y.data(), x.size())) << info.option;
    }
  }
}

std::string test_name(const testing::TestParamInfo<std::string>& info) {
  std::string name = std::filesystem::path(info.param).stem().string();
  for (char& c : name) {
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  }
  return name;
}
INSTANTIATE_TEST_SUITE_P(All, AnimatedScenes, testing::ValuesIn(scene_names()), test_name);

}  // namespace
}  // namespace octrace::tests
