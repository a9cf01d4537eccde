// Proofs that the paths of a job differ, from its patterns alone: a job of 10^9 views has too many
// paths to compare.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "backend/batch/output_pattern.h"

namespace octrace::batch {

// What the fields of a job's patterns stand for.
struct PathSpace {
  std::vector<std::string> scenes;                       // by scene, made by path_name()
  std::vector<const std::vector<std::string>*> cameras;  // by scene; or one for all
  std::vector<std::int64_t> frames;                      // empty: frame 0 alone
  std::uint64_t views = 0;

  const std::vector<std::string>& cameras_of(std::size_t scene) const {
    return *cameras[cameras.size() == 1 ? 0 : scene];
  }
};

// True: no two views, nor two of `aovs`, share a path. False: they may. Costs no more than a look
// at each scene's cameras.
bool surely_distinct(const OutputPattern& pattern, const std::vector<std::string>& aovs,
                     const PathSpace& space);

// True: no path of the one is a path of the other. The heads are what comes before the patterns.
bool surely_apart(const std::string& head_a, const OutputPattern& a, const std::string& head_b,
                  const OutputPattern& b);

}  // namespace octrace::batch
