// The pictures of one comparison, small enough that a page of two hundred stays readable.
#pragma once

#include <string>

#include "validation/compare/beauty.h"
#include "validation/compare/geometry.h"
#include "validation/compare/planes.h"
#include "validation/report/png.h"

namespace octrace::validation {

// PNG files in memory; empty: the images do not have that plane. Silhouettes and their difference
// keep every pixel; depths and errors are at most kPictureWidth wide, where a pixel of the error
// shows the largest error that fell into it.
struct Pictures {
  std::uint32_t width = 0, height = 0;  // of the images themselves
  std::string silhouette_a, silhouette_b, difference;
  std::string depth_a, depth_b, depth_error;
  double near = 0.0, far = 0.0;  // the depths at the two ends of the colour scale
  std::string beauty_a, beauty_b, flip;
};
inline constexpr std::uint32_t kPictureWidth = 400;

// The error map's scale is logarithmic between these; errors outside take the end's colour.
inline constexpr double kErrorLow = 1e-8, kErrorHigh = 1e-1;

Pictures geometry_pictures(const Planes& a, const Planes& b, bool has_depth);
void add_beauty_pictures(Pictures& pictures, const Planes& a, const Planes& b,
                         const BeautyMetrics& metrics);

// Colour scales, t in [0, 1].
Rgb depth_color(double t);  // viridis
Rgb error_color(double t);  // inferno
// Of the difference picture.
inline constexpr Rgb kNeither{24, 26, 32}, kBoth{120, 126, 138}, kOnlyA{255, 140, 26},
    kOnlyB{51, 160, 255};

}  // namespace octrace::validation
