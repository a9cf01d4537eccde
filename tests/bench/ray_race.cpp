#include "tests/bench/ray_race.h"

#include <fmt/format.h>

#include <algorithm>

#include "tests/bench/hits.h"
#include "tests/bench/octrace_tracer.h"
#include "tests/bench/statistics.h"

namespace octrace::bench {

namespace {

const char* name_of(EmbreePeer::Interface interface) {
  switch (interface) {
    case EmbreePeer::Interface::single:
      return "single";
    case EmbreePeer::Interface::packet:
      return "packet";
    case EmbreePeer::Interface::stream:
      return "stream";
  }
  return "";
}

}  // namespace

Race race(const Racers& racers, const Rays& rays, const RaceOptions& options) {
  Race result;
  result.options = options;
  result.set = rays.set;
  result.rays = rays.rays.size();
  const bool coherent = rays.set == RaySet::primary;
  const auto own = [&](unsigned threads, std::vector<kernels::Hit>* hits) {
    return trace_cpu(racers.scene, racers.octree, racers.wide, rays.rays, rays.any_hit, coherent,
                     threads, hits);
  };
  const auto peer = [&](EmbreePeer::Interface interface, std::vector<kernels::Hit>* hits) {
    return racers.peer->trace(rays.rays, rays.any_hit, coherent, interface, options.threads, hits);
  };
  std::vector<kernels::Hit> ours, theirs;
  own(options.threads, &ours);
  if (options.scaling_threads != 0) own(options.scaling_threads, nullptr);
  if (racers.peer != nullptr) {
    result.interfaces = {EmbreePeer::Interface::single, EmbreePeer::Interface::packet,
                         EmbreePeer::Interface::stream};
  }
  for (const EmbreePeer::Interface interface : result.interfaces) {
    peer(interface, &theirs);
    result.agreement = std::min(result.agreement, agreement(ours, theirs, rays.any_hit));
  }
  if (!agrees(result)) return result;

  result.peers.resize(result.interfaces.size());
  for (int i = 0; i < options.repeats; ++i) {  // turn about, so that all see the same machine
    result.own.push_back(own(options.threads, nullptr));
    if (options.scaling_threads != 0) {
      result.scaled.push_back(own(options.scaling_threads, nullptr));
    }
    for (std::size_t k = 0; k < result.interfaces.size(); ++k) {
      result.peers[k].push_back(peer(result.interfaces[k], nullptr));
    }
  }
  return result;
}

bool agrees(const Race& race) { return race.agreement >= kLeastAgreement; }

nlohmann::json race_row(const std::string& scene, const Race& race) {
  const auto mrays = [&](double seconds) {
    return seconds > 0.0 ? static_cast<double>(race.rays) / seconds * 1e-6 : 0.0;
  };
  const Spread own = spread_of(race.own);
  nlohmann::json row = {{"scene", scene},
                        {"set", bench::name_of(race.set)},
                        {"device", "cpu"},
                        {"threads", race.options.threads},
                        {"rays", race.rays},
                        {"repeats", race.own.size()},
                        {"mrays_per_s", mrays(own.median)},
                        {"mrays_per_s_lowest", mrays(own.highest)},
                        {"mrays_per_s_highest", mrays(own.lowest)}};
  if (!race.scaled.empty() && own.median > 0.0) {
    const double scaled = spread_of(race.scaled).median;
    row["scaling_threads"] = race.options.scaling_threads;
    row["scaling_mrays_per_s"] = mrays(scaled);
    row["scaling"] = scaled > 0.0 ? own.median / scaled : 0.0;
  }
  double best = 0.0;
  for (std::size_t k = 0; k < race.interfaces.size(); ++k) {
    const Spread spread = spread_of(race.peers[k]);
    const double rate = mrays(spread.median);
    row["peer_" + std::string(name_of(race.interfaces[k])) + "_mrays_per_s"] = rate;
    if (rate <= best) continue;
    best = rate;
    row["peer_interface"] = name_of(race.interfaces[k]);
    row["peer_mrays_per_s_lowest"] = mrays(spread.highest);
    row["peer_mrays_per_s_highest"] = mrays(spread.lowest);
  }
  if (best > 0.0) {
    row["peer"] = "embree";
    row["agreement"] = race.agreement;
    row["peer_mrays_per_s"] = best;
    row["ratio"] = mrays(own.median) / best;
  }
  return row;
}

std::string race_line(const nlohmann::json& row) {
  const auto number = [&](const char* key) { return row[key].get<double>(); };
  std::string line =
      fmt::format("{:<24} {:<8} {:8.2f} [{:.2f}, {:.2f}] Mrays/s", row["scene"].get<std::string>(),
                  row["set"].get<std::string>(), number("mrays_per_s"),
                  number("mrays_per_s_lowest"), number("mrays_per_s_highest"));
  if (row.contains("scaling")) {
    line += fmt::format(", {:.2f} x on {} threads", number("scaling"),
                        row["scaling_threads"].get<unsigned>());
  }
  if (row.contains("nodes_per_ray")) {
    line += fmt::format(", {:.1f} nodes {:.1f} triangles a ray", number("nodes_per_ray"),
                        number("triangles_per_ray"));
  }
  if (row.contains("ratio")) {
    line +=
        fmt::format(", Embree {:.2f} [{:.2f}, {:.2f}] ({}), ratio {:.2f}, {:.4f} % agree",
                    number("peer_mrays_per_s"), number("peer_mrays_per_s_lowest"),
                    number("peer_mrays_per_s_highest"), row["peer_interface"].get<std::string>(),
                    number("ratio"), 100.0 * number("agreement"));
  }
  return line;
}

}  // namespace octrace::bench
