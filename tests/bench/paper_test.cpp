// The seed's experiment: its algorithm against brute force, its figures as text, JSON and SVG.
#include "tests/bench/paper.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>

#include "backend/scene/builtin.h"
#include "tests/bench/hits.h"
#include "tests/bench/seed_tree.h"
#include "tests/bench/svg_chart.h"
#include "tests/support/brute_force.h"

namespace octrace::bench {
namespace {

using kernels::Hit;
using kernels::Ray;

constexpr int kWidth = 64, kHeight = 48;

std::vector<Ray> rays_of(const scene::Camera& camera) {
  const kernels::RayCamera ray_camera = scene::make_ray_camera(camera, kWidth, kHeight);
  std::vector<Ray> rays;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      rays.push_back(
          camera_ray(ray_camera, static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f));
    }
  }
  return rays;
}

TEST(SeedTree, HoldsEveryTriangleOnceAndInItsBoxes) {
  const scene::Scene scene = scene::make_paper_scene();
  for (const std::uint32_t threshold : {1u, 8u, 100u, 100000u}) {
    const SeedTree tree = build_seed_tree(scene.positions, scene.triangles, threshold);
    std::multiset<std::uint32_t> ids(tree.ids.begin(), tree.ids.end());
    ASSERT_EQ(scene.triangles.size(), ids.size());
    for (std::uint32_t i = 0; i < scene.triangles.size(); ++i) EXPECT_EQ(1u, ids.count(i));
    EXPECT_EQ(threshold == 100000u, tree.nodes.size() == 1);
    std::size_t children = 1;
    for (const kernels::SeedNode& node : tree.nodes) {
      const std::uint32_t count = node.count & ~kernels::kSeedLeaf;
      const auto inside = [&](const kernels::Vec3& p) {
        for (int axis = 0; axis < 3; ++axis) {
          if (p[axis] < node.lower[axis] || p[axis] > node.upper[axis]) return false;
        }
        return true;
      };
      if ((node.count & kernels::kSeedLeaf) == 0) {
        EXPECT_LE(count, 8u);
        children += count;
        for (std::uint32_t i = 0; i < count; ++i) {
          EXPECT_TRUE(inside(tree.nodes[node.first + i].lower));
          EXPECT_TRUE(inside(tree.nodes[node.first + i].upper));
        }
        continue;
      }
      std::set<std::uint32_t> vertices;
      for (std::uint32_t i = 0; i < count; ++i) {
        const kernels::Triangle& t = scene.triangles[tree.ids[node.first + i]];
        vertices.insert(t.a);
        EXPECT_TRUE(inside(scene.positions[t.a]) && inside(scene.positions[t.b]) &&
                    inside(scene.positions[t.c]));
      }
      EXPECT_LE(vertices.size(), threshold);
    }
    EXPECT_EQ(tree.nodes.size(), children);
  }
}

TEST(Seed, HitsWhatBruteForceHits) {
  const scene::Scene scene = scene::make_paper_scene();
  EXPECT_EQ(855u, scene.positions.size());
  EXPECT_EQ(1692u, scene.triangles.size());
  const SeedTree tree = build_seed_tree(scene.positions, scene.triangles, 8);
  const kernels::SeedView view = tree.view(scene.triangles, scene.positions);
  for (const scene::Camera& camera : scene.cameras) {
    std::vector<Hit> traced, own, watertight;
    for (const Ray& ray : rays_of(camera)) {
      Hit hit, every{ray.tmax, 0.0f, 0.0f, kernels::kNone};
      ASSERT_EQ(kernels::TraceStatus::ok, kernels::seed_trace(view, ray, &hit));
      for (std::uint32_t i = 0; i < scene.triangles.size(); ++i) seed_test(view, ray, i, &every);
      traced.push_back(hit);
      own.push_back(every);
      watertight.push_back(tests::brute_force(scene.positions, scene.triangles, ray));
    }
    EXPECT_EQ(0u, differing_hits(own, traced, false)) << camera.name;
    EXPECT_EQ(1.0, agreement(traced, watertight, false)) << camera.name;
    const auto valid =
        std::count_if(traced.begin(), traced.end(), [](const Hit& hit) { return hit.valid(); });
    EXPECT_GT(valid, kWidth * kHeight / 20) << camera.name;
  }
}

TEST(Seed, SlabTestKnowsRaysAlongAxes) {
  const kernels::Vec3 lower(-1.0f), upper(1.0f);
  const auto meets = [&](kernels::Vec3 origin, kernels::Vec3 direction, float tmax = 100.0f) {
    return kernels::seed_meets_box({origin, 0.0f, direction, tmax}, lower, upper);
  };
  EXPECT_TRUE(meets({0, 0, 5}, {0, 0, -1}));
  EXPECT_FALSE(meets({0, 0, 5}, {0, 0, 1}));
  EXPECT_FALSE(meets({0, 0, 5}, {0, 0, -1}, 3.9f));
  EXPECT_TRUE(meets({1, 1, 5}, {0, 0, -1}));  // in two of the planes
  EXPECT_FALSE(meets({1.001f, 0, 5}, {0, 0, -1}));
  EXPECT_TRUE(meets({5, 5, 5}, {-1, -1, -1}));
  EXPECT_FALSE(meets({5, 5, 5}, {-1, -1, -0.2f}));
}

TEST(Hits, EveryDifferenceIsSeen) {
  const std::vector<Hit> hits = {{1.0f, 0.25f, 0.5f, 3}, {9.0f, 0.0f, 0.0f, kernels::kNone}};
  EXPECT_EQ(0u, differing_hits(hits, hits, false));
  EXPECT_EQ(1.0, agreement(hits, hits, false));
  const auto changed = [&](auto&& change) {
    std::vector<Hit> other = hits;
    change(other);
    return other;
  };
  const auto nudged = changed([](auto& h) { h[0].t = std::nextafter(1.0f, 2.0f); });
  EXPECT_EQ(1u, differing_hits(hits, nudged, false));
  EXPECT_EQ(0u, differing_hits(hits, nudged, true));
  EXPECT_EQ(1.0, agreement(hits, nudged, false));
  EXPECT_EQ(1u, differing_hits(hits, changed([](auto& h) { h[0].v = 0.25f; }), false));
  EXPECT_EQ(1u, differing_hits(hits, changed([](auto& h) { h[0].triangle = 4; }), false));
  EXPECT_EQ(1u, differing_hits(hits, changed([](auto& h) { h[1].triangle = 4; }), true));
  EXPECT_EQ(1u, differing_hits(hits, changed([](auto& h) { h.pop_back(); }), true));
  EXPECT_EQ(0.5, agreement(hits, changed([](auto& h) { h[0] = {1.1f, 0, 0, 4}; }), false));
  EXPECT_EQ(0.5, agreement(hits, changed([](auto& h) { h[1].triangle = 4; }), true));
}

// A result with known times: 2 s and 4 s on the CPU, a tenth and a hundredth of it on the GPU.
PaperResult made_up() {
  PaperResult result;
  result.options.repeats = 2;
  result.cpu = "a <CPU> & more";
  result.gpu = "a GPU";
  for (const PaperFigures& p : kPaperTable) {
    PaperRow row;
    row.z = p.z;
    row.times.seed_cpu = {2.0, 4.0};
    row.times.seed_gpu = {0.2, 0.4};
    row.times.seed_kernels = {0.1, 0.2};
    row.times.fast_cpu = {1.0, 1.0};
    row.times.fast_gpu = {0.01, 0.02};
    row.times.fast_kernels = {0.01, 0.01};
    row.cpu_agreement = 1.0;
    row.gpu_agreement = 1.0;
    row.seed_differing = 0;
    row.fast_differing = 7;
    result.rows.push_back(row);
  }
  return result;
}

TEST(PaperReport, TellsTheSameInTextAndJson) {
  const PaperResult result = made_up();
  const nlohmann::json json = paper_json(result);
  const nlohmann::json& row = json["rows"][3];
  EXPECT_EQ(400, row["z"]);
  EXPECT_NEAR(13.2, row["paper"]["speed_up"].get<double>(), 0.05);
  EXPECT_DOUBLE_EQ(3.0, row["seed"]["cpu"]["median_s"]);
  EXPECT_DOUBLE_EQ(2.0, row["seed"]["cpu"]["lowest_s"]);
  EXPECT_DOUBLE_EQ(4.0, row["seed"]["cpu"]["highest_s"]);
  EXPECT_NEAR(10.0, row["seed"]["speed_up"]["of_medians"].get<double>(), 1e-9);
  EXPECT_NEAR(20.0, row["seed"]["speed_up_kernels"]["of_medians"].get<double>(), 1e-9);
  EXPECT_NEAR(100.0, row["octrace"]["speed_up"]["all"][0].get<double>(), 1e-9);
  EXPECT_EQ(7, row["octrace_pixels_differing_cpu_gpu"]);
  EXPECT_TRUE(json["gpu_missing"].is_null());
  const std::string text = paper_text(result);
  EXPECT_TRUE(std::regex_search(text, std::regex("\n +400 +21000 +1590 +13.2\n"))) << text;
  EXPECT_TRUE(std::regex_search(
      text, std::regex("\n +400 +3000 \\[2000, 4000\\] +300 \\[200, 400\\] +10.0 ")))
      << text;
  EXPECT_NE(std::string::npos, text.find("octrace: 100.0 50.0\n")) << text;
  EXPECT_NE(std::string::npos, text.find("differ in 0 pixels (seed) and 7 (octrace)")) << text;
}

// Empty where every tag is closed in order and no character is left unescaped.
std::string xml_fault(const std::string& xml) {
  std::vector<std::string> open;
  std::size_t at = 0;
  while (at < xml.size()) {
    if (xml[at] != '<') {
      if (xml[at] == '>') return "a stray >";
      if (xml[at] == '&' &&
          !std::regex_search(xml.begin() + at, xml.end(), std::regex("^&(amp|lt|gt|quot);"),
                             std::regex_constants::match_continuous)) {
        return "a stray &";
      }
      ++at;
      continue;
    }
    const std::size_t end = xml.find('>', at);
    if (end == std::string::npos) return "an open tag at the end";
    const std::string tag = xml.substr(at + 1, end - at - 1);
    const std::string name = tag.substr(0, tag.find_first_of(" /", 1));
    if (std::count(tag.begin(), tag.end(), '"') % 2 != 0) return "quotes in " + tag;
    if (tag.find('<') != std::string::npos) return "a < in " + tag;
    if (tag[0] == '/') {
      if (open.empty() || "/" + open.back() != tag) return "unexpected <" + tag + ">";
      open.pop_back();
    } else if (tag.back() != '/') {
      open.push_back(name);
    }
    at = end + 1;
  }
  return open.empty() ? "" : "unclosed " + open.back();
}

std::size_t count(const std::string& text, const std::string& pattern) {
  std::size_t n = 0;
  for (std::size_t at = 0; (at = text.find(pattern, at)) != std::string::npos; ++at) ++n;
  return n;
}

TEST(PaperFigure, IsWellFormedAndDrawsWhatWasMeasured) {
  PaperResult result = made_up();
  const std::string svg = paper_svg(result);
  EXPECT_EQ("", xml_fault(svg));
  EXPECT_NE(std::string::npos, svg.find("a &lt;CPU&gt; &amp; more"));
  EXPECT_EQ(std::string::npos, svg.find("not measured"));
  EXPECT_EQ(8u, count(svg, "<polyline"));
  EXPECT_EQ(4u * 4u + 3u * 2u, count(svg, "<circle"));  // the paper's mean has no marks
  result.gpu_missing = "no GPU";
  for (PaperRow& row : result.rows) {
    row.times.seed_gpu = row.times.fast_gpu = row.times.seed_kernels = row.times.fast_kernels = {};
  }
  const std::string cpu_only = paper_svg(result);
  EXPECT_EQ("", xml_fault(cpu_only));
  EXPECT_EQ(4u, count(cpu_only, "(not measured)"));
  EXPECT_EQ(4u, count(cpu_only, "<polyline"));
  EXPECT_NE(std::string::npos, cpu_only.find("no figures, no GPU"));
}

TEST(SvgChart, PutsPointsWhereTheAxisSays) {
  Chart chart{"t", "x", "y", {0, 10}, true, {{"s", "#000000", {{0, 1}, {10, 1000}}}}};
  const auto points = [](const std::string& svg) {
    std::smatch m;
    EXPECT_TRUE(std::regex_search(
        svg, m, std::regex("points=\"([0-9.]+),([0-9.]+) ([0-9.]+),([0-9.]+)\"")));
    return std::array<double, 4>{std::stod(m[1]), std::stod(m[2]), std::stod(m[3]),
                                 std::stod(m[4])};
  };
  const auto label_at = [](const std::string& svg, const std::string& label) {
    std::smatch m;
    EXPECT_TRUE(std::regex_search(
        svg, m,
        std::regex("<text x=\"[0-9.]+\" y=\"([0-9.]+)\" text-anchor=\"end\"[^>]*>" + label +
                   "</text>")))
        << label;
    return m.empty() ? 0.0 : std::stod(m[1]) - 4.0;
  };
  const std::string log_svg = svg_page("page", {chart}, {});
  EXPECT_NEAR(label_at(log_svg, "1"), points(log_svg)[1], 0.2);
  EXPECT_NEAR(label_at(log_svg, "1000"), points(log_svg)[3], 0.2);
  EXPECT_LT(points(log_svg)[0], points(log_svg)[2]);
  chart.log_y = false;
  chart.x_ticks = {10, 0};  // runs downwards
  const std::string svg = svg_page("page", {chart}, {});
  EXPECT_NEAR(label_at(svg, "1000"), points(svg)[3], 0.2);
  EXPECT_GT(points(svg)[0], points(svg)[2]);
}

class PaperProgram : public testing::Test {
 protected:
  PaperProgram() {
    std::string name = (std::filesystem::temp_directory_path() / "octrace-XXXXXX").string();
    folder_ = mkdtemp(name.data());
  }
  ~PaperProgram() override { std::filesystem::remove_all(folder_); }

  int run(const std::string& arguments) {
    const std::string command =
        std::string(OCTRACE_BENCH) + " " + arguments + " >" + path("out").string() + " 2>&1";
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::filesystem::path path(const std::string& name) const { return folder_ / name; }
  std::string read(const std::string& name) const {
    std::ostringstream text;
    text << std::ifstream(path(name)).rdbuf();
    return text.str();
  }

 private:
  std::filesystem::path folder_;
};

TEST_F(PaperProgram, WritesTextJsonAndFigure) {
  ASSERT_EQ(0, run("paper --device cpu --size 64x48 --repeats 3 --json " + path("p.json").string() +
                   " --svg " + path("p.svg").string()))
      << read("out");
  const nlohmann::json json = nlohmann::json::parse(read("p.json"));
  EXPECT_EQ(855, json["vertices"]);
  EXPECT_EQ("--device cpu was asked for", json["gpu_missing"]);
  ASSERT_EQ(4u, json["rows"].size());
  for (const nlohmann::json& row : json["rows"]) {
    EXPECT_GE(row["agreement"].get<double>(), kLeastAgreement);
    EXPECT_GT(row["hit_share"].get<double>(), 0.05);
    for (const char* side : {"seed", "octrace"}) {
      const nlohmann::json& cpu = row[side]["cpu"];
      EXPECT_EQ(3u, cpu["all_s"].size());
      EXPECT_GT(cpu["lowest_s"].get<double>(), 0.0);
      EXPECT_LE(cpu["lowest_s"].get<double>(), cpu["median_s"].get<double>());
      EXPECT_LE(cpu["median_s"].get<double>(), cpu["highest_s"].get<double>());
      EXPECT_TRUE(row[side]["gpu"].is_null());
      EXPECT_TRUE(row[side]["speed_up"].is_null());
    }
  }
  EXPECT_EQ("", xml_fault(read("p.svg")));
  EXPECT_NE(std::string::npos, read("out").find("Table 1, the seed's algorithm"));
}

TEST_F(PaperProgram, RefusesWhatItCannotMeasure) {
  EXPECT_EQ(2, run("paper --size 64"));
  EXPECT_EQ(2, run("paper --size 64x48x2"));
  EXPECT_EQ(2, run("paper --size 64x99999999"));
  EXPECT_EQ(2, run("paper --device gpu"));
  EXPECT_NE(0, run("paper --repeats 0"));
  EXPECT_EQ(5, run("paper --device cpu --size 8x8 --repeats 1 --svg " + path("no/p.svg").string()));
}

}  // namespace
}  // namespace octrace::bench
