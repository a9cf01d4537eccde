// octrace-bench build: millions of triangles a second of each builder, beside Embree's.
#include <fmt/format.h>

#include <chrono>

#include "backend/octree/octree.h"
#include "tests/bench/bench_scene.h"
#include "tests/bench/build_gpu.h"
#include "tests/bench/commands.h"
#include "tests/bench/embree_peer.h"
#include "tests/bench/statistics.h"

namespace octrace::bench {

namespace {

struct Options {
  std::vector<std::string> scenes;
  std::string json;
  bool peer = false;
  unsigned threads = 1;
  int repeats = 5;
  int gpu = -1;
};

struct Measurement {
  std::string builder;
  std::vector<double> seconds;
  octree::Statistics statistics;  // empty for peers
};

double build_seconds(const scene::Scene& scene, octree::Builder builder, unsigned threads,
                     octree::Statistics& statistics) {
  octree::BuildOptions options;
  options.builder = builder;
  options.threads = threads;
  const auto start = std::chrono::steady_clock::now();
  const util::Result<octree::Octree> octree = octree::build(scene, options);
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (octree) statistics = octree::statistics(*octree);
  return seconds;
}

nlohmann::json row_of(const std::string& scene, std::uint64_t triangles, unsigned threads,
                      const Measurement& m) {
  const Spread spread = spread_of(m.seconds);
  const double rate = static_cast<double>(triangles) / spread.median * 1e-6;
  fmt::print("{:<24} {:<14} {:9.2f} ms [{:.2f}, {:.2f}] {:8.2f} Mtri/s", scene, m.builder,
             spread.median * 1e3, spread.lowest * 1e3, spread.highest * 1e3, rate);
  nlohmann::json row = {{"scene", scene},     {"builder", m.builder},      {"triangles", triangles},
                        {"threads", threads}, {"ms", spread.median * 1e3}, {"mtri_per_s", rate}};
  if (m.statistics.nodes != 0) {
    const double bytes = static_cast<double>(m.statistics.bytes) / static_cast<double>(triangles);
    row["bytes_per_triangle"] = bytes;
    row["sah_cost"] = m.statistics.sah_cost;
    row["depth"] = m.statistics.depth;
    fmt::print(", {:.1f} B a triangle, cost {:.2f}, depth {}", bytes, m.statistics.sah_cost,
               m.statistics.depth);
  }
  fmt::print("\n");
  std::fflush(stdout);
  return row;
}

int run(const Options& options) {
  nlohmann::json rows = nlohmann::json::array();
  for (const std::string& name : options.scenes) {
    util::Result<scene::Scene> scene = load_scene(name);
    if (!scene) return fail(scene.error());
    std::vector<Measurement> all = {{"octrace sah", {}, {}}, {"octrace median", {}, {}}};
    if (options.peer) {
      all.push_back({"embree medium", {}, {}});
      all.push_back({"embree high", {}, {}});
    }
    for (int i = 0; i < options.repeats; ++i) {
      all[0].seconds.push_back(
          build_seconds(*scene, octree::Builder::sah, options.threads, all[0].statistics));
      all[1].seconds.push_back(
          build_seconds(*scene, octree::Builder::median, options.threads, all[1].statistics));
      if (!options.peer) continue;
      all[2].seconds.push_back(
          EmbreePeer(*scene, EmbreePeer::Quality::medium, options.threads).build_seconds());
      all[3].seconds.push_back(
          EmbreePeer(*scene, EmbreePeer::Quality::high, options.threads).build_seconds());
    }
    if (options.gpu >= 0) {
      util::Result<GpuBuild> built = build_on_gpu(*scene, options.gpu, options.repeats);
      if (!built) return fail(built.error());
      all.push_back({"octrace hploc", built->seconds, octree::statistics(built->octree)});
    }
    for (const Measurement& m : all) {
      rows.push_back(row_of(name.substr(name.find_last_of('/') + 1), scene->triangles.size(),
                            options.threads, m));
    }
  }
  return write_json(options.json, rows);
}

}  // namespace

void add_build_command(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("build", "Speed, size and quality of the octree builders");
  command->add_option("--scene", options->scenes, "Scene file or builtin:NAME; may be repeated")
      ->required();
  command->add_option("--threads", options->threads, "CPU threads")
      ->check(CLI::Range(1u, 4096u))
      ->capture_default_str();
  command->add_option("--gpu", options->gpu, "Build on this GPU as well")
      ->check(CLI::Range(0, 1023));
  command->add_option("--repeats", options->repeats, "Timed runs a row")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  if (EmbreePeer::available()) {
    command->add_flag("--peer", options->peer, "Build with Embree as well, turn about");
  }
  command->add_option("--json", options->json, "Write the rows to this file");
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace octrace::bench
