// Proofs that the paths of a job differ, from its patterns alone: a job of 10^9 views has too many
// paths to compare.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "backend/batch/camera_list.h"
#include "backend/batch/output_pattern.h"

namespace octrace::batch {

// What the fields of a job's patterns stand for.
struct PathSpace {
  std::span<const std::string> scenes;  // by scene, made by path_name()
  std::span<const CameraList> cameras;
  std::span<const std::uint32_t> cameras_of;  // by scene, of `cameras`; empty: the first for all
  std::span<const std::int64_t> frames;       // empty: frame 0 alone
  std::uint64_t views = 0;

  const CameraList& cameras_in(std::size_t scene) const {
    return cameras[cameras_of.empty() ? 0 : cameras_of[scene]];
  }
};

// True: no two views, nor two of `aovs`, share a path. False: they may. Costs no more than a look
// at each pair of a scene and a camera, and with most patterns less.
bool surely_distinct(const OutputPattern& pattern, const std::vector<std::string>& aovs,
                     const PathSpace& space);

// True: no path of the one is a path of the other. The heads are what comes before the patterns.
bool surely_apart(const std::string& head_a, const OutputPattern& a, const std::string& head_b,
                  const OutputPattern& b);

}  // namespace octrace::batch
