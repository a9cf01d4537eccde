// A check that cannot fail is worthless: bugs are planted between a scene and octrace's image of
// it, and each must be noticed by comparing with the real POV-Ray and Blender.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <functional>
#include <optional>

#include "backend/app/reference_batch.h"
#include "backend/app/validation_views.h"
#include "backend/util/atomic_file.h"
#include "tests/validation/bug_scene.h"
#include "validation/reference/process.h"
#include "validation/report/report.h"

namespace octrace::validation::test {
namespace {

using app::SceneSession;
using nlohmann::json;

constexpr std::uint32_t kWidth = 640, kHeight = 480;

// Where the bug sits decides who can see it: POV-Ray is given octrace's own triangles, so a
// loader's bug is Blender's to find.
struct Bug {
  const char* name;
  std::function<void(json&)> file = {};             // what the loader makes of the file
  std::function<void(scene::Scene&)> scene = {};    // what the loader makes of its arrays
  std::function<void(scene::Camera&)> camera = {};  // where the rays go
  std::function<void(app::ViewOptions&)> view = {};
  std::function<void(Planes&)> image = {};
  bool loader() const { return file || scene; }
};

double focal_length() { return 0.5 * kHeight / std::tan(0.5 * bug_scene_camera().yfov); }

// The same view, with its principal point moved by some pixels.
void shift(scene::Camera& camera, double x, double y) {
  camera.type = scene::CameraType::pinhole;
  camera.fx = camera.fy = focal_length();
  camera.cx = 0.5 * kWidth + x;
  camera.cy = 0.5 * kHeight + y;
}

bool belongs_to(const scene::Scene& scene, std::size_t triangle, std::uint32_t node) {
  return scene.geometries[scene.triangle_geometry[triangle]].object == node;
}

void radial_depth(Planes& planes) {
  for (std::uint32_t y = 0; y < kHeight; ++y) {
    for (std::uint32_t x = 0; x < kWidth; ++x) {
      const double u = (x + 0.5 - 0.5 * kWidth) / focal_length();
      const double v = (y + 0.5 - 0.5 * kHeight) / focal_length();
      float& z = planes.z[std::size_t{y} * kWidth + x];
      z = static_cast<float>(z * std::sqrt(1.0 + u * u + v * v));
    }
  }
}

template <class T>
void flip_rows(std::vector<T>& plane) {
  for (std::uint32_t y = 0; y < kHeight / 2; ++y) {
    const auto row = plane.begin() + std::ptrdiff_t(y * kWidth);
    std::swap_ranges(row, row + kWidth, plane.begin() + std::ptrdiff_t((kHeight - 1 - y) * kWidth));
  }
}

const std::vector<Bug>& bugs() {
  using scene::Camera;
  using scene::Scene;
  static const std::vector<Bug> list{
      {.name = "camera shifted by half a pixel", .camera = [](Camera& c) { shift(c, 0.5, 0.5); }},
      {.name = "camera shifted by 0.1 px", .camera = [](Camera& c) { shift(c, 0.1, 0); }},
      {.name = "yfov x 1.001", .camera = [](Camera& c) { c.yfov *= 1.001; }},
      {.name = "zNear at the object", .camera = [](Camera& c) { c.znear = 5.0; }},
      {.name = "depth radial instead of planar", .image = radial_depth},
      {.name = "depth off by 1e-5",
       .image =
           [](Planes& p) {
             for (float& z : p.z) z *= 1.00001f;
           }},
      {.name = "Y flipped",
       .image = [](Planes& p) { flip_rows(p.mask), flip_rows(p.z), flip_rows(p.object_id); }},
      {.name = "object ids off by one",
       .image =
           [](Planes& p) {
             for (auto& id : p.object_id) id += id > 0;
           }},
      {.name = "back faces not culled", .view = [](app::ViewOptions& v) { v.cull = false; }},
      {.name = "alpha mode MASK not followed",
       .view = [](app::ViewOptions& v) { v.alpha = false; }},
      {.name = "flipped winding",
       .scene =
           [](Scene& s) {
             for (auto& t : s.triangles) std::swap(t.b, t.c);
           }},
      {.name = "winding not swapped where a matrix mirrors",
       .scene =
           [](Scene& s) {
             for (std::size_t i = 0; i < s.triangles.size(); ++i) {
               if (belongs_to(s, i, kMirroredNode)) std::swap(s.triangles[i].b, s.triangles[i].c);
             }
           }},
      {.name = "dropped triangle strip parity",
       .scene =
           [](Scene& s) {
             bool odd = false;
             for (std::size_t i = 0; i < s.triangles.size(); ++i) {
               if (!belongs_to(s, i, kStripNode)) continue;
               if (odd) std::swap(s.triangles[i].b, s.triangles[i].c);
               odd = !odd;
             }
           }},
      {.name = "the strip's last triangle missing",
       .scene =
           [](Scene& s) {
             for (std::size_t i = s.triangles.size(); i-- > 0;) {
               if (!belongs_to(s, i, kStripNode)) continue;
               s.triangles[i].b = s.triangles[i].c = s.triangles[i].a;
               break;
             }
           }},
      {.name = "transposed node matrix",
       .file =
           [](json& f) {
             json& m = f["nodes"][kMatrixNode]["matrix"];
             for (int r = 0; r < 3; ++r) {
               for (int c = r + 1; c < 3; ++c) std::swap(m[4 * c + r], m[4 * r + c]);
             }
           }},
      {.name = "ignored negative scale",
       .file =
           [](json& f) {
             f["nodes"][kMirroredNode]["scale"] = {1, 1, 1};
           }},
      {.name = "ignored byteStride",
       .file = [](json& f) { f["bufferViews"][0].erase("byteStride"); }},
      {.name = "ignored byteOffset of an accessor",
       .file = [](json& f) { f["accessors"][0]["byteOffset"] = 12; }},
      {.name = "mesh instance missing",
       .file = [](json& f) { f["nodes"][kInstanceNode].erase("mesh"); }},
      {.name = "translation ignored",
       .file = [](json& f) { f["nodes"][kInstanceNode].erase("translation"); }},
  };
  return list;
}

class PlantedBugs : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* program : {"povray", "blender"}) {
      if (!find_program(program)) GTEST_SKIP() << program << " is not installed";
    }
    auto scratch = Scratch::create("octrace-test");
    ASSERT_TRUE(scratch);
    scratch_.emplace(std::move(*scratch));
    view_.size = {kWidth, kHeight};
    make_references();
  }

  std::unique_ptr<SceneSession> open(const json& file) {
    app::SceneRequest request;
    request.source = scratch_->file("scene.gltf");
    EXPECT_TRUE(util::write_file(request.source, file.dump()));
    auto session = batch::open_scene(request);
    EXPECT_TRUE(session) << (session ? "" : session.error().to_string());
    return session ? std::move(*session) : nullptr;
  }

  void make_references() {
    const auto session = open(bug_scene());
    ASSERT_TRUE(session);
    app::ReferenceOptions options;
    options.povray = "povray";
    options.blender = "blender";
    options.jobs = 2;
    options.size = view_.size;
    auto batch = app::ReferenceBatch::create(options);
    ASSERT_TRUE(batch);
    app::SceneRequest request;
    request.source = scratch_->file("scene.gltf");
    const scene::Camera camera = bug_scene_camera();
    ASSERT_TRUE(batch->add(request, session->scene, {&camera, 1}));
    reference_ = std::move(batch->run()[0]);
    ASSERT_TRUE(*reference_.povray) << reference_.povray->error().to_string();
    ASSERT_TRUE(*reference_.blender) << reference_.blender->error().to_string();
  }

  Planes render(const Bug& bug) {
    json file = bug_scene();
    if (bug.file) bug.file(file);
    auto session = open(file);
    if (!session) return {};
    if (bug.scene) {
      bug.scene(session->scene);
      auto octree = octree::build(session->scene, {});
      EXPECT_TRUE(octree);
      session->octree = std::move(*octree);
    }
    scene::Camera camera = bug_scene_camera();
    if (bug.camera) bug.camera(camera);
    app::ViewOptions view = view_;
    if (bug.view) bug.view(view);
    auto planes = app::render_planes(session->scene, session->octree, camera, view);
    EXPECT_TRUE(planes) << (planes ? "" : planes.error().to_string());
    if (!planes) return {};
    if (bug.image) bug.image(*planes);
    return std::move(*planes);
  }

  Comparison compare(const Planes& ours, const char* program) {
    const bool povray = program == std::string("POV-Ray");
    Comparison comparison;
    comparison.second = program;
    CompareOptions options;
    options.tolerances = povray ? kPovrayTolerances : kBlenderTolerances;
    options.pictures = false;
    const auto filled = fill_comparison(
        comparison, ours, povray ? **reference_.povray : **reference_.blender, options);
    EXPECT_TRUE(filled) << (filled ? "" : filled.error().to_string());
    return comparison;
  }

  std::optional<Scratch> scratch_;
  app::ViewOptions view_;
  app::ReferenceView reference_;
};

// One test for all: the reference images take seconds to make.
TEST_F(PlantedBugs, EachIsCaughtAndNoneIsImagined) {
  const Planes right = render({.name = "none"});
  for (const char* program : {"POV-Ray", "Blender"}) {
    const Comparison comparison = compare(right, program);
    ASSERT_EQ(comparison.status, Status::agree) << one_line(comparison);
    ASSERT_GT(comparison.geometry->interior, 40000u);
  }
  for (const Bug& bug : bugs()) {
    SCOPED_TRACE(bug.name);
    const Planes planes = render(bug);
    ASSERT_FALSE(planes.mask.empty());
    bool caught = false;
    std::string lines;
    for (const char* program : {"POV-Ray", "Blender"}) {
      if (bug.loader() && program == std::string("POV-Ray")) continue;
      const Comparison comparison = compare(planes, program);
      caught = caught || comparison.status == Status::differ;
      lines += fmt::format("  {}: {}\n", bug.name, one_line(comparison));
    }
    EXPECT_TRUE(caught) << lines;
    fmt::print("{}", lines);
  }
}

}  // namespace
}  // namespace octrace::validation::test
