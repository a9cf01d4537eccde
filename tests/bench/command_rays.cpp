// octrace-bench rays: Mrays/s of the three ray sets: on the CPU beside Embree in the same process,
// turn about; or on a GPU, whose hits are compared with the CPU's bit for bit.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "backend/render/device.h"
#include "tests/bench/bench_scene.h"
#include "tests/bench/build_gpu.h"
#include "tests/bench/commands.h"
#include "tests/bench/embree_peer.h"
#include "tests/bench/hits.h"
#include "tests/bench/octrace_tracer.h"
#include "tests/bench/ray_gpu.h"
#include "tests/bench/ray_race.h"
#include "tests/bench/ray_sets.h"
#include "tests/bench/statistics.h"
#include "tests/bench/views.h"

namespace octrace::bench {

namespace {

constexpr int kLeastLaunches = 10;  // on a GPU

struct Options {
  std::vector<std::string> scenes;
  std::string camera, size = "1280x720", peer, json, builder = "sah", device = "cpu";
  std::vector<std::string> sets = {"primary", "bounce", "ao"};
  unsigned threads = 1, scaling = 0;
  int repeats = 5;
  std::uint32_t views = 0;
  bool count = false;
};

class SceneBench {
 public:
  SceneBench(const Options& options, std::string name, scene::Scene scene, octree::Octree octree)
      : options_(options),
        name_(std::move(name)),
        scene_(std::move(scene)),
        octree_(std::move(octree)),
        wide_(octree::make_wide(octree_.view())) {
    if (options.peer == "embree") {
      // Embree's device limits oneTBB's threads for the whole process, octrace's with them.
      peer_.emplace(scene_, EmbreePeer::Quality::high, std::max(options.threads, options.scaling));
    }
  }

  util::Result<void> use_gpu(int device) {
    util::Result<std::unique_ptr<RayGpu>> gpu = make_ray_gpu(octree_, device);
    if (!gpu) return gpu.error();
    gpu_ = std::move(*gpu);
    return {};
  }

  std::vector<scene::Camera> views() const {
    return scattered_views(scene_, octree_, wide_, options_.views);
  }

  bool run(const kernels::RayCamera& camera, int width, int height, nlohmann::json& rows) {
    const std::vector<kernels::Ray> primary = primary_rays(camera, width, height);
    std::vector<kernels::Hit> hits;
    trace_cpu(scene_, octree_, wide_, primary, false, true, options_.threads, &hits);
    ++view_;
    for (const RaySet set : {RaySet::primary, RaySet::bounce, RaySet::ao}) {
      if (std::find(options_.sets.begin(), options_.sets.end(), bench::name_of(set)) ==
          options_.sets.end())
        continue;
      const Rays rays = set == RaySet::primary ? Rays{set, false, primary}
                                               : secondary_rays(set, scene_, primary, hits);
      if (gpu_ != nullptr) {
        const util::Result<bool> same = run_set_on_gpu(rays, rows);
        if (!same) fail(same.error());
        if (!same || !*same) return false;
      } else if (!run_set(rays, rows)) {
        return false;
      }
    }
    return true;
  }

 private:
  // False where too few hits agree with the peer's.
  bool run_set(const Rays& rays, nlohmann::json& rows) {
    const Race result = race({scene_, octree_, wide_, peer_ ? &*peer_ : nullptr}, rays,
                             {options_.threads, options_.scaling, options_.repeats});
    if (!agrees(result)) {
      fmt::print(stderr,
                 "octrace-bench: {} {}: hits agree with Embree's on only {:.4f} % of the rays\n",
                 name_, bench::name_of(rays.set), 100.0 * result.agreement);
      return false;
    }
    nlohmann::json row = race_row(name_, result);
    row["builder"] = options_.builder;
    row["view"] = view_;
    if (options_.count) {
      const Work work = count_work(scene_, octree_, rays.rays, rays.any_hit);
      row["nodes_per_ray"] = work.nodes;
      row["triangles_per_ray"] = work.triangles;
    }
    fmt::print("{}\n", race_line(row));
    std::fflush(stdout);
    rows.push_back(row);
    return true;
  }

  // False where a hit differs from the CPU's.
  util::Result<bool> run_set_on_gpu(const Rays& rays, nlohmann::json& rows) {
    std::vector<kernels::Hit> expected;
    trace_cpu(scene_, octree_, wide_, rays.rays, rays.any_hit, false, options_.threads, &expected);
    if (util::Result<void> loaded = gpu_->load(rays.rays); !loaded) return loaded.error();
    const util::Result<std::vector<kernels::Hit>> found = gpu_->trace(rays.any_hit);
    if (!found) return found.error();
    const std::uint64_t differing = differing_hits(expected, *found, rays.any_hit);
    if (differing != 0) {
      fmt::print(stderr, "octrace-bench: {} {}: {} of {} hits differ between CPU and GPU\n", name_,
                 bench::name_of(rays.set), differing, rays.rays.size());
      return false;
    }
    std::vector<double> seconds;
    for (int i = 0; i < std::max(options_.repeats, kLeastLaunches); ++i) {
      const util::Result<double> time = gpu_->time(rays.any_hit);
      if (!time) return time.error();
      seconds.push_back(*time);
    }
    const Spread spread = spread_of(seconds);
    const auto mrays = [&](double s) {
      return s > 0.0 ? static_cast<double>(rays.rays.size()) / s * 1e-6 : 0.0;
    };
    fmt::print(
        "{:<24} {:<8} {:9.1f} best, {:.1f} median, {:.1f} worst Mrays/s, {} rays, {}, 0 hits "
        "differ from the CPU's\n",
        name_, bench::name_of(rays.set), mrays(spread.lowest), mrays(spread.median),
        mrays(spread.highest), rays.rays.size(), gpu_->name());
    std::fflush(stdout);
    rows.push_back({{"scene", name_},
                    {"set", bench::name_of(rays.set)},
                    {"device", "cuda"},
                    {"builder", options_.builder},
                    {"view", view_},
                    {"device_name", gpu_->name()},
                    {"rays", rays.rays.size()},
                    {"launches", seconds.size()},
                    {"mrays_per_s", mrays(spread.lowest)},
                    {"mrays_per_s_median", mrays(spread.median)},
                    {"mrays_per_s_lowest", mrays(spread.highest)},
                    {"differing_hits", differing}});
    return true;
  }

  const Options& options_;
  std::string name_;
  scene::Scene scene_;
  octree::Octree octree_;
  octree::WideOctree wide_;
  std::optional<EmbreePeer> peer_;
  std::unique_ptr<RayGpu> gpu_;
  std::uint32_t view_ = 0;  // counted from 1
};

util::Result<octree::Octree> build(const Options& options, const scene::Scene& scene,
                                   const render::DeviceChoice& device) {
  if (options.builder == "hploc") {
    util::Result<GpuBuild> built = build_on_gpu(scene, device.index, 1);
    if (!built) return built.error();
    return std::move(built->octree);
  }
  octree::BuildOptions build;
  build.builder = options.builder == "median"    ? octree::Builder::median
                  : options.builder == "quality" ? octree::Builder::quality
                                                 : octree::Builder::sah;
  return octree::build(scene, build);
}

bool is_count(const std::string& key) { return key.ends_with("_per_ray"); }

// The means over the views of a scene, whose rows are those from `first` on: geometric ones of
// rates, arithmetic ones of counts. Views whose set has no rays have no part in them.
void print_means(const nlohmann::json& rows, std::size_t first) {
  struct Sum {
    double value = 0.0;
    int views = 0;
  };
  std::map<std::string, std::map<std::string, Sum>> sums;
  for (std::size_t i = first; i < rows.size(); ++i) {
    if (rows[i]["rays"] == 0) continue;
    for (const char* key : {"mrays_per_s", "ratio", "nodes_per_ray", "triangles_per_ray"}) {
      if (!rows[i].contains(key)) continue;
      const double value = rows[i][key];
      Sum& sum = sums[rows[i]["set"]][key];
      sum.value += is_count(key) ? value : std::log(value);
      ++sum.views;
    }
  }
  for (const auto& [set, keys] : sums) {
    fmt::print("mean of {} views, {}:", keys.begin()->second.views, set);
    for (const auto& [key, sum] : keys) {
      const double mean = sum.value / sum.views;
      fmt::print(" {} {:.2f}", key, is_count(key) ? mean : std::exp(mean));
    }
    fmt::print("\n");
  }
}

int run(const Options& options) {
  int width = 0, height = 0;
  if (!parse_size(options.size, &width, &height)) return 2;
  const util::Result<render::DeviceChoice> device = render::parse_device(options.device);
  if (!device) return fail(device.error());
  const bool gpu = device->kind == render::DeviceKind::cuda;
  if (device->kind == render::DeviceKind::automatic || (gpu && !options.peer.empty())) {
    return fail({util::Exit::usage, "",
                 "--device needs cpu or cuda[:N]; --peer runs on the CPU only", "", ""});
  }
  if (gpu) {
    const std::string unavailable = render::cuda_unavailable(device->index);
    if (!unavailable.empty()) {
      return fail({util::Exit::unsupported, "", unavailable, "", ""});
    }
  }
  nlohmann::json rows = nlohmann::json::array();
  for (const std::string& name : options.scenes) {
    const std::size_t first = rows.size();
    util::Result<scene::Scene> scene = load_scene(name);
    if (!scene) return fail(scene.error());
    util::Result<scene::Camera> camera =
        choose_camera(*scene, options.camera, double(width) / height);
    if (!camera) return fail(camera.error());
    util::Result<octree::Octree> octree = build(options, *scene, *device);
    if (!octree) return fail(octree.error());
    SceneBench bench(options, name.substr(name.find_last_of('/') + 1), std::move(*scene),
                     std::move(*octree));
    if (gpu) {
      if (util::Result<void> ready = bench.use_gpu(device->index); !ready) {
        return fail(ready.error());
      }
    }
    const std::vector<scene::Camera> cameras =
        options.views == 0 ? std::vector<scene::Camera>{*camera} : bench.views();
    if (cameras.empty()) {
      return fail({util::Exit::usage, "", "--views needs a scene with a surface", "", ""});
    }
    for (const scene::Camera& view : cameras) {
      if (!bench.run(scene::make_ray_camera(view, width, height), width, height, rows)) return 1;
    }
    if (options.views > 1) print_means(rows, first);
  }
  return write_json(options.json, rows);
}

}  // namespace

void add_rays_command(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("rays", "Mrays/s of primary, bounce and ao rays");
  command->add_option("--scene", options->scenes, "Scene file or builtin:NAME; may be repeated")
      ->required();
  command->add_option("--camera", options->camera, "Name of a camera of the scene");
  command->add_option("--size", options->size, "Size of the primary image, WxH")
      ->capture_default_str();
  command->add_option("--sets", options->sets, "Ray sets")
      ->delimiter(',')
      ->check(CLI::IsMember({"primary", "bounce", "ao"}));
  command->add_option("--threads", options->threads, "CPU threads")
      ->check(CLI::Range(1u, 4096u))
      ->capture_default_str();
  command
      ->add_option("--scaling", options->scaling,
                   "Also trace with octrace on this many CPU threads, in the same turns")
      ->check(CLI::Range(1u, 4096u));
  command->add_option("--builder", options->builder, "Octree builder")
      ->check(CLI::IsMember({"hploc", "median", "sah", "quality"}))
      ->capture_default_str();
  command->add_option("--repeats", options->repeats, "Timed runs a row")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command
      ->add_option("--device", options->device,
                   "cpu, cuda or cuda:N; on a GPU the best of at least 10 launches counts")
      ->capture_default_str();
  if (EmbreePeer::available()) {
    command
        ->add_option("--peer", options->peer,
                     "Trace the same rays with this library on the CPU, turn about")
        ->check(CLI::IsMember({"embree"}));
  }
  command
      ->add_option("--views", options->views,
                   "Instead of one camera, so many from all over the scene, and their means")
      ->excludes("--camera")
      ->check(CLI::Range(0u, 1000u));
  command->add_flag("--count", options->count, "Count nodes and triangles tested a ray");
  command->add_option("--json", options->json, "Write the rows to this file");
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace octrace::bench
