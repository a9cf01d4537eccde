// octrace-bench build: millions of triangles a second of each builder, beside Embree's, and the
// most memory that a build takes.
#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <chrono>
#include <map>

#include "backend/octree/octree.h"
#include "backend/octree/wide.h"
#include "tests/bench/bench_scene.h"
#include "tests/bench/build_gpu.h"
#include "tests/bench/commands.h"
#include "tests/bench/embree_peer.h"
#include "tests/bench/peak_memory.h"
#include "tests/bench/statistics.h"

namespace octrace::bench {

namespace {

struct Options {
  std::vector<std::string> scenes;
  std::vector<octree::Builder> builders = {octree::Builder::sah, octree::Builder::median,
                                           octree::Builder::quality};
  std::string json;
  bool peer = false;
  unsigned threads = 1;
  int repeats = 5;
  int gpu = -1;
};

struct Measurement {
  std::string builder;
  std::vector<double> seconds;
  std::vector<double> wide_seconds;  // of the CPU's own nodes, made from the octree
  octree::Statistics statistics;     // empty for peers
  std::uint64_t peak_bytes = 0;      // the scene and all that the build had at once
};

template <class Call>
double seconds_of(const Call& call) {
  const auto start = std::chrono::steady_clock::now();
  call();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void build_once(const scene::Scene& scene, octree::Builder builder, unsigned threads,
                Measurement& m) {
  octree::BuildOptions options;
  options.builder = builder;
  options.threads = threads;
  const PeakMemory memory;
  util::Result<octree::Octree> octree = octree::Octree();
  m.seconds.push_back(seconds_of([&] { octree = octree::build(scene, options); }));
  m.peak_bytes = std::max(m.peak_bytes, memory.bytes());
  if (!octree) return;
  m.statistics = octree::statistics(*octree);
  octree::WideOctree wide;
  tbb::task_arena(static_cast<int>(threads)).execute([&] {
    m.wide_seconds.push_back(seconds_of([&] { wide = octree::make_wide(octree->view()); }));
  });
}

std::uint64_t bytes_of(const scene::Scene& scene) {
  const auto bytes = [](const auto& v) { return std::uint64_t{sizeof(v[0])} * v.size(); };
  return bytes(scene.positions) + bytes(scene.triangles) + bytes(scene.triangle_geometry) +
         bytes(scene.normals) + bytes(scene.tangents) + bytes(scene.uvs) + bytes(scene.colors) +
         bytes(scene.texels);
}

nlohmann::json row_of(const std::string& name, const scene::Scene& scene, unsigned threads,
                      const Measurement& m) {
  const Spread spread = spread_of(m.seconds);
  const auto triangles = static_cast<double>(scene.triangles.size());
  const double rate = triangles / spread.median * 1e-6;
  fmt::print("{:<24} {:<15} {:9.2f} ms [{:.2f}, {:.2f}] {:8.2f} Mtri/s", name, m.builder,
             spread.median * 1e3, spread.lowest * 1e3, spread.highest * 1e3, rate);
  nlohmann::json row = {
      {"scene", name},      {"builder", m.builder},      {"triangles", scene.triangles.size()},
      {"threads", threads}, {"ms", spread.median * 1e3}, {"mtri_per_s", rate}};
  if (m.statistics.nodes != 0) {
    const double bytes = static_cast<double>(m.statistics.bytes) / triangles;
    row["bytes_per_triangle"] = bytes;
    row["sah_cost"] = m.statistics.sah_cost;
    row["depth"] = m.statistics.depth;
    fmt::print(", {:.1f} B a triangle, cost {:.2f}, depth {}", bytes, m.statistics.sah_cost,
               m.statistics.depth);
  }
  if (!m.wide_seconds.empty()) {
    row["wide_ms"] = spread_of(m.wide_seconds).median * 1e3;
    fmt::print(", CPU nodes {:.2f} ms", spread_of(m.wide_seconds).median * 1e3);
  }
  if (m.peak_bytes != 0) {
    const std::uint64_t scene_bytes = bytes_of(scene);
    const std::uint64_t peak = scene_bytes + m.peak_bytes;
    row["scene_bytes"] = scene_bytes;
    row["octree_bytes"] = m.statistics.bytes;
    row["peak_bytes"] = peak;
    fmt::print(", peak {:.1f} of {:.1f} B a triangle", static_cast<double>(peak) / triangles,
               static_cast<double>(scene_bytes) / triangles);
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
    std::vector<Measurement> all;
    for (const octree::Builder builder : options.builders) {
      all.push_back({std::string("octrace ") + octree::name_of(builder), {}, {}, {}});
    }
    if (options.peer) {
      all.push_back({"embree medium", {}, {}, {}});
      all.push_back({"embree high", {}, {}, {}});
    }
    for (int i = 0; i < options.repeats; ++i) {
      std::size_t at = 0;
      for (const octree::Builder builder : options.builders) {
        build_once(*scene, builder, options.threads, all[at++]);
      }
      if (!options.peer) continue;
      for (const auto quality : {EmbreePeer::Quality::medium, EmbreePeer::Quality::high}) {
        all[at++].seconds.push_back(EmbreePeer(*scene, quality, options.threads).build_seconds());
      }
    }
    if (options.gpu >= 0) {
      util::Result<GpuBuild> built = build_on_gpu(*scene, options.gpu, options.repeats);
      if (!built) return fail(built.error());
      all.push_back({"octrace hploc", built->seconds, {}, octree::statistics(built->octree)});
    }
    for (const Measurement& m : all) {
      rows.push_back(row_of(name.substr(name.find_last_of('/') + 1), *scene, options.threads, m));
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
  const std::map<std::string, octree::Builder> names = {{"sah", octree::Builder::sah},
                                                        {"median", octree::Builder::median},
                                                        {"quality", octree::Builder::quality}};
  command->add_option("--builders", options->builders, "Builders to measure")
      ->transform(CLI::CheckedTransformer(names))
      ->delimiter(',');
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
