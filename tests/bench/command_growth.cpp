// octrace-bench growth: rays and builds over one terrain at growing sizes, octrace beside Embree.
#include <fmt/format.h>

#include <fstream>
#include <optional>
#include <set>

#include "backend/util/atomic_file.h"
#include "tests/bench/bench_scene.h"
#include "tests/bench/clock.h"
#include "tests/bench/commands.h"
#include "tests/bench/growth.h"
#include "tests/bench/octrace_tracer.h"
#include "tests/bench/ray_race.h"
#include "tests/bench/statistics.h"

namespace octrace::bench {

namespace {

using nlohmann::json;

struct Options {
  std::vector<std::uint32_t> quads = {256, 512, 1024, 2048, 4096};
  std::vector<std::string> merge;
  std::string size = "512x288", json, svg;
  bool peer = false;
  unsigned threads = 1;
  int repeats = 5;
};

constexpr double kBuildSeconds = 10.0;  // a builder is not run again once it has taken as long

struct Builds {
  std::string name;
  std::vector<double> seconds;
  double total = 0.0;
  bool due(const Options& options) const {
    return seconds.empty() ||
           (static_cast<int>(seconds.size()) < options.repeats && total < kBuildSeconds);
  }
  void add(double s) {
    seconds.push_back(s);
    total += s;
  }
};

json build_row(const json& head, unsigned threads, const Builds& builds) {
  const Spread spread = spread_of(builds.seconds);
  const double triangles = head["triangles"].get<double>();
  json row = head;
  row["builder"] = builds.name;
  row["threads"] = threads;
  row["repeats"] = builds.seconds.size();
  row["ms"] = spread.median * 1e3;
  row["ms_lowest"] = spread.lowest * 1e3;
  row["ms_highest"] = spread.highest * 1e3;
  row["mtri_per_s"] = triangles / spread.median * 1e-6;
  fmt::print("{:<24} {:<14} {:9.2f} ms [{:.2f}, {:.2f}] {:8.2f} Mtri/s\n",
             head["scene"].get<std::string>(), builds.name, row["ms"].get<double>(),
             row["ms_lowest"].get<double>(), row["ms_highest"].get<double>(),
             row["mtri_per_s"].get<double>());
  std::fflush(stdout);
  return row;
}

// Builds turn about, so that all see the same machine; the last octree is kept.
util::Result<octree::Octree> run_builds(const Options& options, const scene::Scene& scene,
                                        const json& head, json& rows) {
  octree::BuildOptions build;
  build.threads = options.threads;
  util::Result<octree::Octree> octree = octree::Octree();
  Builds own{"octrace sah", {}}, medium{"embree medium", {}}, high{"embree high", {}};
  while (own.due(options) || (options.peer && (medium.due(options) || high.due(options)))) {
    if (own.due(options)) {
      octree = octree::Octree();  // never two at once: the largest scenes fill the memory
      const double start = wall_seconds();
      octree = octree::build(scene, build);
      own.add(wall_seconds() - start);
      if (!octree) return octree.error();
    }
    if (!options.peer) continue;
    for (auto [builds, quality] : {std::pair{&medium, EmbreePeer::Quality::medium},
                                   std::pair{&high, EmbreePeer::Quality::high}}) {
      if (builds->due(options)) {
        builds->add(EmbreePeer(scene, quality, options.threads).build_seconds());
      }
    }
  }
  rows.push_back(build_row(head, options.threads, own));
  if (options.peer) {
    rows.push_back(build_row(head, options.threads, medium));
    rows.push_back(build_row(head, options.threads, high));
  }
  return octree;
}

util::Result<void> run_size(const Options& options, std::uint32_t quads, int width, int height,
                            json& rows) {
  const std::string name = fmt::format("builtin:terrain:{}", quads);
  const util::Result<scene::Scene> scene = load_scene(name);
  if (!scene) return scene.error();
  const json head = {{"scene", name}, {"quads", quads}, {"triangles", scene->triangles.size()}};
  const util::Result<octree::Octree> octree = run_builds(options, *scene, head, rows);
  if (!octree) return octree.error();
  const octree::WideOctree wide = octree::make_wide(octree->view());
  std::optional<EmbreePeer> peer;
  if (options.peer) peer.emplace(*scene, EmbreePeer::Quality::high, options.threads);

  const kernels::RayCamera camera = scene::make_ray_camera(scene->cameras[0], width, height);
  const std::vector<kernels::Ray> primary = primary_rays(camera, width, height);
  std::vector<kernels::Hit> hits;
  trace_cpu(*scene, *octree, wide, primary, false, true, 1, &hits);
  for (const RaySet set : {RaySet::primary, RaySet::bounce, RaySet::ao}) {
    const Rays rays = set == RaySet::primary ? Rays{set, false, primary}
                                             : secondary_rays(set, *scene, primary, hits);
    const Race result =
        race({*scene, *octree, wide, peer ? &*peer : nullptr}, rays, {1, 0, options.repeats});
    if (!agrees(result)) {
      return util::Error{util::Exit::different, name,
                         fmt::format("{}: hits agree with Embree's on only {:.4f} % of the rays",
                                     name_of(set), 100.0 * result.agreement),
                         "", ""};
    }
    json row = race_row(name, result);
    row.update(head);
    const Work work = count_work(*scene, *octree, rays.rays, rays.any_hit);
    row["nodes_per_ray"] = work.nodes;
    row["triangles_per_ray"] = work.triangles;
    fmt::print("{}\n", race_line(row));
    std::fflush(stdout);
    rows.push_back(row);
  }
  return {};
}

// Rows of an earlier run, whose sizes need not be measured again.
util::Result<json> read_rows(const std::string& path) {
  std::ifstream file(path);
  if (!file) return util::Error{util::Exit::io, path, "cannot be read", "", ""};
  json rows = json::parse(file, nullptr, false);
  const bool ok = rows.is_array() && std::all_of(rows.begin(), rows.end(), [](const json& row) {
                    return row.is_object() && row.contains("quads") && row.contains("triangles");
                  });
  if (!ok)
    return util::Error{util::Exit::invalid_input, path, "needs rows of octrace-bench growth", "",
                       ""};
  return rows;
}

int run(const Options& options) {
  int width = 0, height = 0;
  if (!parse_size(options.size, &width, &height)) return 2;
  json rows = json::array();
  std::set<std::uint32_t> done;
  for (const std::string& path : options.merge) {
    const util::Result<json> earlier = read_rows(path);
    if (!earlier) return fail(earlier.error());
    for (const json& row : *earlier) {
      done.insert(row["quads"].get<std::uint32_t>());
      rows.push_back(row);
    }
  }
  for (const std::uint32_t quads : options.quads) {
    if (!done.insert(quads).second) continue;
    if (util::Result<void> ran = run_size(options, quads, width, height, rows); !ran) {
      return fail(ran.error());
    }
  }
  add_growth(rows);
  fmt::print("{}", growth_report(rows));
  if (!options.svg.empty()) {
    const std::string note = fmt::format("Rays: one thread. Builds: {} threads.", options.threads);
    const util::Result<void> written = util::write_file(options.svg, growth_svg(rows, note));
    if (!written) return fail(written.error());
  }
  return write_json(options.json, rows);
}

}  // namespace

void add_growth_command(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("growth", "Rays and builds over terrains of growing size");
  command->add_option("--quads", options->quads, "Sides of the terrains, 2 n^2 triangles each")
      ->delimiter(',')
      ->check(CLI::Range(2u, 32767u))
      ->capture_default_str();
  command->add_option("--size", options->size, "Size of the primary image, WxH")
      ->capture_default_str();
  command->add_option("--threads", options->threads, "CPU threads of the builds; rays have one")
      ->check(CLI::Range(1u, 4096u))
      ->capture_default_str();
  command
      ->add_option("--repeats", options->repeats,
                   "Timed runs a row; fewer builds where they take seconds")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command->add_option("--merge", options->merge,
                      "Rows of an earlier run, whose sizes are not measured again");
  if (EmbreePeer::available()) {
    command->add_flag("--peer", options->peer, "The same with Embree, turn about");
  }
  command->add_option("--json", options->json, "Write the rows to this file");
  command->add_option("--svg", options->svg, "Draw them into this file");
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace octrace::bench
