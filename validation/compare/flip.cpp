#include "validation/compare/flip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace octrace::validation {
namespace {

using Color = std::array<double, 3>;
using Matrix = std::array<Color, 3>;

// Linear sRGB to XYZ and the D65 white, as the authors' implementation has them.
constexpr Matrix kToXyz{{{10135552.0 / 24577794, 8788810.0 / 24577794, 4435075.0 / 24577794},
                         {2613072.0 / 12288897, 8788810.0 / 12288897, 887015.0 / 12288897},
                         {1425312.0 / 73733382, 8788810.0 / 73733382, 70074185.0 / 73733382}}};
constexpr Matrix kFromXyz{{{3.241003275, -1.537398934, -0.498615861},
                           {-0.969224334, 1.875930071, 0.041554224},
                           {0.055639423, -0.204011202, 1.057148933}}};
constexpr Color kWhite{0.950428545, 1.000000000, 1.088900371};

// Section 4: exponents and break points of the colour and feature pipelines.
constexpr double kColorExponent = 0.7, kFeatureExponent = 0.5;
constexpr double kErrorBreak = 0.4, kErrorAtBreak = 0.95;
constexpr double kFeatureWidth = 0.082;  // degrees

// One Gaussian a * sqrt(pi / b) * exp(-pi^2 d^2 / b) of a contrast sensitivity function, d in
// degrees.
struct Sensitivity {
  double a, b;
};
constexpr Sensitivity kAchromatic[] = {{1.0, 0.0047}};
constexpr Sensitivity kRedGreen[] = {{1.0, 0.0053}};
constexpr Sensitivity kBlueYellow[] = {{34.1, 0.04}, {13.5, 0.025}};
constexpr double kWidestSensitivity = 0.04;

Color multiply(const Matrix& m, const Color& v) {
  Color out;
  for (int r = 0; r < 3; ++r) out[r] = m[r][0] * v[0] + m[r][1] * v[1] + m[r][2] * v[2];
  return out;
}

Color to_opponent(const Color& rgb) {  // YCxCz
  const Color xyz = multiply(kToXyz, rgb);
  const double x = xyz[0] / kWhite[0], y = xyz[1] / kWhite[1], z = xyz[2] / kWhite[2];
  return {116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)};
}

Color from_opponent(const Color& color) {
  const double y = (color[0] + 16.0) / 116.0;
  const Color xyz{(y + color[1] / 500.0) * kWhite[0], y * kWhite[1],
                  (y - color[2] / 200.0) * kWhite[2]};
  return multiply(kFromXyz, xyz);
}

Color to_lab(const Color& rgb) {
  constexpr double kDelta = 6.0 / 29.0;
  const auto f = [](double t) {
    return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3 * kDelta * kDelta) + 4.0 / 29.0;
  };
  const Color xyz = multiply(kToXyz, rgb);
  const double x = f(xyz[0] / kWhite[0]), y = f(xyz[1] / kWhite[1]), z = f(xyz[2] / kWhite[2]);
  return {116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)};
}

Color hunt(const Color& lab) {  // chroma matters less in the dark
  return {lab[0], 0.01 * lab[0] * lab[1], 0.01 * lab[0] * lab[2]};
}

double hyab(const Color& p, const Color& q) {
  return std::abs(p[0] - q[0]) + std::hypot(p[1] - q[1], p[2] - q[2]);
}

using Plane = std::vector<double>;
using Kernel = std::vector<double>;  // odd length, centred

struct Size {
  int width, height;
};

// Both passes of a separable filter; the border's pixels go on beyond it.
Plane convolve(const Plane& input, Size size, const Kernel& along_x, const Kernel& along_y) {
  const int radius_x = static_cast<int>(along_x.size() / 2);
  const int radius_y = static_cast<int>(along_y.size() / 2);
  Plane rows(input.size()), output(input.size());
  for (int y = 0; y < size.height; ++y) {
    const double* line = input.data() + std::ptrdiff_t{y} * size.width;
    for (int x = 0; x < size.width; ++x) {
      double sum = 0.0;
      for (int k = -radius_x; k <= radius_x; ++k) {
        sum += along_x[k + radius_x] * line[std::clamp(x + k, 0, size.width - 1)];
      }
      rows[std::size_t(y) * size.width + x] = sum;
    }
  }
  for (int y = 0; y < size.height; ++y) {
    for (int k = -radius_y; k <= radius_y; ++k) {
      const std::size_t from = std::size_t(std::clamp(y + k, 0, size.height - 1)) * size.width;
      const double weight = along_y[k + radius_y];
      for (int x = 0; x < size.width; ++x) {
        output[std::size_t(y) * size.width + x] += weight * rows[from + x];
      }
    }
  }
  return output;
}

Kernel gaussian(double falloff, int radius) {  // exp(-falloff * i^2)
  Kernel kernel(2 * radius + 1);
  for (int i = -radius; i <= radius; ++i) kernel[i + radius] = std::exp(-falloff * i * i);
  return kernel;
}

double sum(const Kernel& kernel) {
  double total = 0.0;
  for (const double weight : kernel) total += weight;
  return total;
}

Plane filter_sensitivity(const Plane& input, Size size, std::span<const Sensitivity> terms,
                         double pixels_per_degree) {
  constexpr double kPi = std::numbers::pi;
  const int radius = static_cast<int>(
      std::ceil(3.0 * std::sqrt(kWidestSensitivity / (2.0 * kPi * kPi)) * pixels_per_degree));
  Plane output(input.size());
  double total = 0.0;
  for (const Sensitivity& term : terms) {
    const double scale = term.a * std::sqrt(kPi / term.b);
    const Kernel kernel =
        gaussian(kPi * kPi / (term.b * pixels_per_degree * pixels_per_degree), radius);
    const Plane blurred = convolve(input, size, kernel, kernel);
    for (std::size_t i = 0; i < output.size(); ++i) output[i] += scale * blurred[i];
    total += scale * sum(kernel) * sum(kernel);
  }
  for (double& value : output) value /= total;
  return output;
}

// Scaled so that the weights on either side of zero sum to 1, over both dimensions: `other` is the
// kernel of the other direction.
Kernel normalised_by_sign(Kernel kernel, const Kernel& other) {
  double positive = 0.0, negative = 0.0;
  for (const double weight : kernel) (weight > 0 ? positive : negative) += weight * sum(other);
  for (double& weight : kernel) weight /= weight > 0 ? positive : -negative;
  return kernel;
}

enum class Feature { edge, point };

Plane feature_strength(const Plane& luminance, Size size, Feature feature,
                       double pixels_per_degree) {
  const double sigma = 0.5 * kFeatureWidth * pixels_per_degree;
  const int radius = static_cast<int>(std::ceil(3.0 * sigma));
  const Kernel smooth = gaussian(0.5 / (sigma * sigma), radius);
  Kernel derivative = smooth;
  for (int i = -radius; i <= radius; ++i) {
    derivative[i + radius] *= feature == Feature::edge ? -i : i * i / (sigma * sigma) - 1.0;
  }
  derivative = normalised_by_sign(derivative, smooth);
  Plane x = convolve(luminance, size, derivative, smooth);
  const Plane y = convolve(luminance, size, smooth, derivative);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = std::hypot(x[i], y[i]);
  return x;
}

struct Opponent {
  Plane planes[3];
};

Opponent opponent_planes(std::span<const float> rgb, std::size_t pixels) {
  Opponent out;
  for (Plane& plane : out.planes) plane.resize(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    Color color;
    for (int c = 0; c < 3; ++c) color[c] = std::clamp(double{rgb[3 * i + c]}, 0.0, 1.0);
    const Color opponent = to_opponent(color);
    for (int c = 0; c < 3; ++c) out.planes[c][i] = opponent[c];
  }
  return out;
}

std::vector<Color> perceived(const Opponent& image, Size size, double pixels_per_degree) {
  const Plane y = filter_sensitivity(image.planes[0], size, kAchromatic, pixels_per_degree);
  const Plane cx = filter_sensitivity(image.planes[1], size, kRedGreen, pixels_per_degree);
  const Plane cz = filter_sensitivity(image.planes[2], size, kBlueYellow, pixels_per_degree);
  std::vector<Color> out(y.size());
  for (std::size_t i = 0; i < y.size(); ++i) {
    Color rgb = from_opponent({y[i], cx[i], cz[i]});
    for (double& value : rgb) value = std::clamp(value, 0.0, 1.0);
    out[i] = hunt(to_lab(rgb));
  }
  return out;
}

// Most of the range goes to errors below the break, where people tell them apart.
double redistribute(double error, double largest) {
  const double bend = kErrorBreak * largest;
  if (error < bend) return kErrorAtBreak / bend * error;
  return kErrorAtBreak + (error - bend) / (largest - bend) * (1.0 - kErrorAtBreak);
}

}  // namespace

std::vector<float> flip(std::span<const float> reference, std::span<const float> test,
                        std::uint32_t width, std::uint32_t height, double pixels_per_degree) {
  const std::size_t pixels = std::size_t{width} * height;
  const Size size{static_cast<int>(width), static_cast<int>(height)};
  const Opponent a = opponent_planes(reference, pixels), b = opponent_planes(test, pixels);
  const std::vector<Color> seen_a = perceived(a, size, pixels_per_degree);
  const std::vector<Color> seen_b = perceived(b, size, pixels_per_degree);

  Plane luminance[2] = {a.planes[0], b.planes[0]};
  for (Plane& plane : luminance) {
    for (double& value : plane) value = (value + 16.0) / 116.0;
  }
  Plane strength[2][2];
  for (int i = 0; i < 2; ++i) {
    strength[i][0] = feature_strength(luminance[i], size, Feature::edge, pixels_per_degree);
    strength[i][1] = feature_strength(luminance[i], size, Feature::point, pixels_per_degree);
  }

  const double largest =
      std::pow(hyab(hunt(to_lab({0, 1, 0})), hunt(to_lab({0, 0, 1}))), kColorExponent);
  std::vector<float> out(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    const double color =
        redistribute(std::pow(hyab(seen_a[i], seen_b[i]), kColorExponent), largest);
    const double edge = std::abs(strength[0][0][i] - strength[1][0][i]);
    const double point = std::abs(strength[0][1][i] - strength[1][1][i]);
    const double feature = std::pow(std::max(edge, point) / std::numbers::sqrt2, kFeatureExponent);
    out[i] = static_cast<float>(std::pow(color, 1.0 - feature));
  }
  return out;
}

}  // namespace octrace::validation
