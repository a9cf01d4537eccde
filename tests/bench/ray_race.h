// octrace and Embree over one set of rays in one process: hits compared first, then timed turn
// about.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "backend/octree/octree.h"
#include "backend/octree/wide.h"
#include "backend/scene/scene.h"
#include "tests/bench/embree_peer.h"
#include "tests/bench/ray_sets.h"

namespace octrace::bench {

struct Racers {
  const scene::Scene& scene;
  const octree::Octree& octree;
  const octree::WideOctree& wide;
  const EmbreePeer* peer = nullptr;  // null: octrace alone
};

struct RaceOptions {
  unsigned threads = 1;
  unsigned scaling_threads = 0;  // octrace on as many threads as well, in the same turns; 0: not
  int repeats = 5;
};

struct Race {
  RaceOptions options;
  RaySet set = RaySet::primary;
  std::uint64_t rays = 0;
  std::vector<double> own, scaled;  // seconds of each turn; scaled: on scaling_threads
  std::vector<EmbreePeer::Interface> interfaces;
  std::vector<std::vector<double>> peers;  // by interface
  double agreement = 1.0;  // the least share of rays whose hits agree, over the interfaces
};

// The first run of each, whose hits are compared, also warms it up. Where fewer than
// kLeastAgreement of the rays agree with any interface of the peer, nothing is timed.
Race race(const Racers& racers, const Rays& rays, const RaceOptions& options);
bool agrees(const Race& race);

// scene, set, mrays_per_s (median), its spread, and what the peer did by its best interface.
nlohmann::json race_row(const std::string& scene, const Race& race);
std::string race_line(const nlohmann::json& row);

}  // namespace octrace::bench
