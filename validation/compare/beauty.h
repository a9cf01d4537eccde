// Shaded images of one scene: root mean square error and FLIP.
#pragma once

#include <vector>

#include "backend/util/result.h"
#include "validation/compare/geometry.h"
#include "validation/compare/planes.h"
#include "validation/compare/tolerances.h"

namespace octrace::validation {

struct BeautyMetrics {
  double rmse = 0.0;       // linear RGB held to [0, 1], over all pixels and channels
  double flip_mean = 0.0;  // 0: look the same, 1: as different as can be
  double flip_max = 0.0;
  std::vector<float> flip;  // a value a pixel: the report's error map
};

// The second image is the reference. Errors (exit 3): sizes differ, no R, G, B.
util::Result<BeautyMetrics> compare_beauty(const Planes& a, const Planes& b);

std::vector<Check> judge(const BeautyMetrics& metrics, const Tolerances& tolerances);

}  // namespace octrace::validation
