#include "validation/report/pictures.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace octrace::validation {
namespace {

constexpr int kScale = 255;  // palette entries of a colour scale; entry kScale is the background
constexpr Rgb kBackground{24, 26, 32};

// Polynomials fitted to matplotlib's colour maps by Matt Zucker (CC0), within 0.01.
using Coefficients = double[7][3];
constexpr Coefficients kViridis = {
    {0.2777273272, 0.0054073445, 0.3340998053},   {0.1050930431, 1.4046135299, 1.3845901627},
    {-0.3308618287, 0.2148475595, 0.0950951630},  {-4.6342304988, -5.7991009734, -19.3324409563},
    {6.2282699363, 14.1799333669, 56.6905526007}, {4.7763849977, -13.7451453777, -65.3530326334},
    {-5.4354558559, 4.6458526122, 26.3124352495}};
constexpr Coefficients kInferno = {{0.0002189403691, 0.001651004631, -0.01948089843},
                                   {0.1065134194, 0.5639564368, 3.9327123889},
                                   {11.6024930825, -3.9728539657, -15.9423941063},
                                   {-41.7039961314, 17.4363988822, 44.3541451987},
                                   {77.1629356994, -33.4023589421, -81.8073092574},
                                   {-71.3194282450, 32.6260642640, 73.2095198591},
                                   {25.1311262248, -12.2426689524, -23.0703250029}};

Rgb evaluate(const Coefficients& c, double t) {
  t = std::clamp(t, 0.0, 1.0);
  Rgb color;
  for (int k = 0; k < 3; ++k) {
    double value = c[6][k];
    for (int i = 5; i >= 0; --i) value = value * t + c[i][k];
    color[static_cast<std::size_t>(k)] =
        static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(value, 0.0, 1.0)));
  }
  return color;
}

std::vector<Rgb> palette_of(Rgb (*color)(double)) {
  std::vector<Rgb> palette;
  for (int i = 0; i < kScale; ++i) palette.push_back(color(i / (kScale - 1.0)));
  palette.push_back(kBackground);
  return palette;
}

// Pixels of the image that fall into one of the picture: `step` by `step` of them.
struct Grid {
  std::uint32_t step, width, height;
};

Grid grid_for(std::uint32_t width, std::uint32_t height) {
  const std::uint32_t step = (width + kPictureWidth - 1) / kPictureWidth;
  return {step, (width + step - 1) / step, (height + step - 1) / step};
}

template <class Visit>
void cell(const Grid& grid, std::uint32_t x, std::uint32_t y, const Planes& planes, Visit visit) {
  for (std::uint32_t v = y * grid.step; v < std::min((y + 1) * grid.step, planes.height); ++v) {
    for (std::uint32_t u = x * grid.step; u < std::min((x + 1) * grid.step, planes.width); ++u) {
      visit(std::size_t{v} * planes.width + u);
    }
  }
}

template <class Value>  // Value(pixel index) -> position on the scale, negative: background
std::string scale_picture(const Planes& planes, const std::vector<Rgb>& palette, bool largest,
                          Value value) {
  const Grid grid = grid_for(planes.width, planes.height);
  std::vector<std::uint8_t> indices;
  for (std::uint32_t y = 0; y < grid.height; ++y) {
    for (std::uint32_t x = 0; x < grid.width; ++x) {
      double shown = -1.0;
      cell(grid, x, y, planes, [&](std::size_t i) {
        if (largest || shown < 0.0) shown = std::max(shown, value(i));
      });
      indices.push_back(shown < 0.0 ? kScale
                                    : static_cast<std::uint8_t>(
                                          std::lround(std::clamp(shown, 0.0, 1.0) * (kScale - 1))));
    }
  }
  return encode_palette_png(grid.width, grid.height, indices, palette);
}

std::string depth_picture(const Planes& planes, double near, double far) {
  static const std::vector<Rgb> palette = palette_of(depth_color);
  const double range = far > near ? far - near : 1.0;
  return scale_picture(planes, palette, false, [&](std::size_t i) {
    return planes.mask[i] && std::isfinite(planes.z[i])
               ? std::clamp((planes.z[i] - near) / range, 0.0, 1.0)
               : -1.0;
  });
}

std::string error_picture(const Planes& a, const Planes& b) {
  static const std::vector<Rgb> palette = palette_of(error_color);
  const std::vector<float> errors = depth_errors(a, b);
  const double decades = std::log10(kErrorHigh / kErrorLow);
  return scale_picture(a, palette, true, [&](std::size_t i) {
    if (errors[i] < 0.0f) return -1.0;
    const double error = std::clamp(double{errors[i]}, kErrorLow, kErrorHigh);
    return std::log10(error / kErrorLow) / decades;
  });
}

std::string beauty_picture(const Planes& planes) {
  const Grid grid = grid_for(planes.width, planes.height);
  std::vector<std::uint8_t> samples;
  for (std::uint32_t y = 0; y < grid.height; ++y) {
    for (std::uint32_t x = 0; x < grid.width; ++x) {
      double sum[3] = {}, count = 0.0;
      cell(grid, x, y, planes, [&](std::size_t i) {
        for (std::size_t c = 0; c < 3; ++c) {
          sum[c] += std::clamp(double{planes.rgb[3 * i + c]}, 0.0, 1.0);
        }
        count += 1.0;
      });
      for (const double channel : sum) {
        const double v = channel / count;
        const double srgb = v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
        samples.push_back(static_cast<std::uint8_t>(std::lround(255.0 * srgb)));
      }
    }
  }
  return encode_rgb_png(grid.width, grid.height, samples);
}

}  // namespace

Rgb depth_color(double t) { return evaluate(kViridis, t); }
Rgb error_color(double t) { return evaluate(kInferno, t); }

Pictures geometry_pictures(const Planes& a, const Planes& b, bool has_depth) {
  Pictures pictures;
  pictures.width = a.width;
  pictures.height = a.height;
  const Rgb silhouette[2] = {kNeither, {226, 229, 235}};
  pictures.silhouette_a = encode_palette_png(a.width, a.height, a.mask, silhouette);
  pictures.silhouette_b = encode_palette_png(b.width, b.height, b.mask, silhouette);
  const Rgb difference[4] = {kNeither, kOnlyA, kOnlyB, kBoth};
  std::vector<std::uint8_t> indices(a.mask.size());
  for (std::size_t i = 0; i < indices.size(); ++i) {
    indices[i] = static_cast<std::uint8_t>(a.mask[i] | b.mask[i] << 1);
  }
  pictures.difference = encode_palette_png(a.width, a.height, indices, difference);
  if (!has_depth) return pictures;

  double near = std::numeric_limits<double>::infinity(), far = -near;
  for (const Planes* planes : {&a, &b}) {
    for (std::size_t i = 0; i < planes->z.size(); ++i) {
      if (!planes->mask[i] || !std::isfinite(planes->z[i])) continue;
      near = std::min(near, double{planes->z[i]});
      far = std::max(far, double{planes->z[i]});
    }
  }
  pictures.near = near <= far ? near : 0.0;
  pictures.far = near <= far ? far : 0.0;
  pictures.depth_a = depth_picture(a, near, far);
  pictures.depth_b = depth_picture(b, near, far);
  pictures.depth_error = error_picture(a, b);
  return pictures;
}

void add_beauty_pictures(Pictures& pictures, const Planes& a, const Planes& b,
                         const BeautyMetrics& metrics) {
  static const std::vector<Rgb> palette = palette_of(error_color);
  pictures.width = a.width;
  pictures.height = a.height;
  pictures.beauty_a = beauty_picture(a);
  pictures.beauty_b = beauty_picture(b);
  pictures.flip =
      scale_picture(a, palette, true, [&](std::size_t i) { return double{metrics.flip[i]}; });
}

}  // namespace octrace::validation
