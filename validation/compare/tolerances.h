// What counts as agreement. The only place: every comparison starts from one of these sets, and
// --tolerance NAME=VALUE changes single entries of it.
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>

#include "backend/util/result.h"

namespace octrace::validation {

// Pixel counts are for the whole image. The geometry figures were measured at 640x480 on ten scenes
// against a double-precision reference: they pass its every scene, and fail a camera that is off by
// 0.01 pixels or a field of view that is 0.1 % too wide.
struct Tolerances {
  double mask_total;     // pixels whose mask differs, at most
  double mask_far;       // of those, more than one pixel from an edge, at most
  double iou;            // intersection over union of the silhouettes, at least
  double depth_median;   // relative depth error on the interior, at most
  double depth_p99;      // the same, 99th percentile
  double outlier_error;  // a covered pixel whose relative depth error is larger is an outlier
  double outlier_count;  // outliers, at most: the larger of this ...
  double outlier_share;  // ... and this share of the covered pixels
  double id_share;       // object ids that differ on the interior: outlier_count or this share
  double rmse;           // beauty, linear RGB held to [0, 1], at most
  double flip;           // beauty, mean FLIP, at most
};

// Two programs' images of one scene agree to the rounding of their depth: POV-Ray's is encoded to
// 2^-30 of the far distance, Blender's is float32 all the way. Coplanar faces of two objects have
// no right id, hence id_share. Beauty is never judged against a reference renderer, whose shading
// is another; its limits are for two path-traced images of one scene by one renderer.
inline constexpr Tolerances kPovrayTolerances{3, 1,    0.9999, 1e-6, 5e-6, 1e-3,
                                              5, 1e-4, 1e-3,   0.05, 0.05};
inline constexpr Tolerances kBlenderTolerances{5, 0,    0.9998, 1.5e-6, 1e-5, 1e-3,
                                               5, 1e-4, 1e-3,   0.05,   0.05};
// octrace compare, where nothing says who wrote the images: the wider of each.
inline constexpr Tolerances kDefaultTolerances{5, 1,    0.9998, 1.5e-6, 1e-5, 1e-3,
                                               5, 1e-4, 1e-3,   0.05,   0.05};

struct ToleranceField {
  std::string_view name;  // as --tolerance and the report say it
  double Tolerances::*value;
  std::string_view description;
};
inline constexpr std::array<ToleranceField, 11> kToleranceFields{{
    {"mask-total", &Tolerances::mask_total, "mask pixels that differ, at most"},
    {"mask-far", &Tolerances::mask_far, "of those, more than 1 px from an edge, at most"},
    {"iou", &Tolerances::iou, "silhouette intersection over union, at least"},
    {"depth-median", &Tolerances::depth_median, "interior relative depth error, median, at most"},
    {"depth-p99", &Tolerances::depth_p99,
     "interior relative depth error, 99th percentile, at most"},
    {"outlier-error", &Tolerances::outlier_error, "relative depth error that makes an outlier"},
    {"outlier-count", &Tolerances::outlier_count, "outliers, at most (or by outlier-share)"},
    {"outlier-share", &Tolerances::outlier_share, "outliers, share of the covered pixels"},
    {"id-share", &Tolerances::id_share, "object ids that differ, share of the interior"},
    {"rmse", &Tolerances::rmse, "beauty: root mean square error, at most"},
    {"flip", &Tolerances::flip, "beauty: mean FLIP, at most"},
}};

// "depth-p99=1e-4" changes one entry. Errors (exit 2): no such name (all are listed), no number.
util::Result<void> override_tolerance(Tolerances& tolerances, std::string_view assignment);

}  // namespace octrace::validation
