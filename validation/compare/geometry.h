// Silhouettes, depths and object ids of two images: how far they are apart.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "backend/util/result.h"
#include "validation/compare/planes.h"
#include "validation/compare/tolerances.h"

namespace octrace::validation {

enum class DisagreementKind { mask, depth, object_id };

struct Disagreement {
  DisagreementKind kind;
  std::uint32_t x, y;  // from the image's top left corner
  double a, b;         // mask 0 or 1, depth, or object id
  double error;        // depth: relative; else 1
};

// Relative depth errors of the interior by decade tenths: bin i holds errors from
// 10^(kHistogramLow + i / kBinsPerDecade); smaller ones (and 0) are in the first, larger in the
// last.
inline constexpr int kHistogramLow = -10, kHistogramHigh = 1, kBinsPerDecade = 4;
inline constexpr int kHistogramBins = (kHistogramHigh - kHistogramLow) * kBinsPerDecade;

// Counts are pixels. Errors are |z_a - z_b| / z_b: the second image is the reference.
//
// A mask pixel that differs is near an edge where both masks have a silhouette edge within its 3x3
// neighbourhood, else far: a shifted silhouette differs near, a hole or a missing part far.
// The interior is where both images are covered throughout the 3x3 neighbourhood and the
// reference's depths in it are within kDepthJump of each other, so that no sampling of an edge
// counts as an error.
inline constexpr double kDepthJump = 0.01;

struct GeometryMetrics {
  std::uint32_t width = 0, height = 0;
  std::uint64_t covered_a = 0, covered_b = 0, covered_both = 0;
  std::uint64_t mask_total = 0, mask_far = 0;
  double iou = 1.0;  // 1 where both are empty

  bool has_depth = false;
  std::uint64_t interior = 0;
  double depth_median = 0, depth_p99 = 0, depth_max = 0;  // on the interior; 0 where it is empty
  std::uint64_t outliers = 0;                             // over all pixels covered in both
  std::array<std::uint64_t, kHistogramBins> histogram{};

  bool has_ids = false;
  std::uint64_t ids_differ = 0;  // on the interior

  std::vector<Disagreement> worst;  // at most kWorst of each kind, the largest first
};
inline constexpr int kWorst = 5;

// Errors (exit 3): the sizes differ, or one of them has no mask.
util::Result<GeometryMetrics> compare_geometry(const Planes& a, const Planes& b,
                                               const Tolerances& tolerances);

// Relative error of each pixel covered in both, -1 elsewhere: the report's heat map.
std::vector<float> depth_errors(const Planes& a, const Planes& b);

// One figure beside its limit.
struct Check {
  std::string name;  // of the tolerance that it is held to
  double value;
  double limit;
  bool at_least;  // false: at most
  bool passed() const { return at_least ? value >= limit : value <= limit; }
};
std::vector<Check> judge(const GeometryMetrics& metrics, const Tolerances& tolerances);

}  // namespace octrace::validation
