// glTF's metallic-roughness BRDF in double precision from the textbook formulas (Heitz 2014: Smith
// with Lambda functions), and its integrals over the hemisphere by quadrature. Shares no code with
// the kernels. The normal is +z.
#pragma once

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <numbers>

namespace octrace::test {

using glm::dvec3;

struct ReferenceBrdf {
  double base, metallic, roughness;

  double alpha() const { return roughness * roughness; }
  double f0() const { return 0.04 * (1 - metallic) + base * metallic; }
  double diffuse_color() const { return base * (1 - metallic); }
  double fresnel(double cosine) const { return f0() + (1 - f0()) * std::pow(1 - cosine, 5); }
  double lambda(const dvec3& w) const {
    const double tangent2 = (1 - w.z * w.z) / (w.z * w.z);
    return (std::sqrt(1 + alpha() * alpha() * tangent2) - 1) / 2;
  }
  double smith(const dvec3& v, const dvec3& l) const { return 1 / (1 + lambda(v) + lambda(l)); }
  double distribution(double cosine) const {
    const double a2 = alpha() * alpha(), d = cosine * cosine * (a2 - 1) + 1;
    return a2 / (std::numbers::pi * d * d);
  }

  double diffuse(const dvec3& v, const dvec3& l) const {
    const dvec3 h = glm::normalize(v + l);
    return (1 - fresnel(glm::dot(v, h))) * diffuse_color() / std::numbers::pi;
  }
  double specular(const dvec3& v, const dvec3& l) const {
    const dvec3 h = glm::normalize(v + l);
    return fresnel(glm::dot(v, h)) * distribution(h.z) * smith(v, l) / (4 * v.z * l.z);
  }
  // What the BRDF makes of light from direction l, cosine included.
  double evaluate(const dvec3& v, const dvec3& l) const {
    if (l.z <= 0 || v.z <= 0) return 0;
    return (diffuse(v, l) + specular(v, l)) * l.z;
  }

  // Integrals of lobe * cosine * (1, direction) over the hemisphere: reflected share of a white
  // sky, and its mean direction.
  struct Moments {
    double share = 0;
    dvec3 direction{0.0};
  };

  Moments diffuse_moments(const dvec3& v) const {
    Moments sum;
    const int n = 64;
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < 2 * n; ++j) {
        const double sine2 = (i + 0.5) / n, phi = std::numbers::pi * (j + 0.5) / n;
        const dvec3 l(std::sqrt(sine2) * std::cos(phi), std::sqrt(sine2) * std::sin(phi),
                      std::sqrt(1 - sine2));
        add(sum, diffuse(v, l) * std::numbers::pi / (2.0 * n * n), l);
      }
    }
    return sum;
  }

  // Over half vectors, warped by their own density D * cosine, which is smooth at any roughness.
  Moments specular_moments(const dvec3& v) const {
    Moments sum;
    const int n = 256;
    for (int i = 0; i < n; ++i) {
      // Denser towards xi = 1, half vectors near the horizon, where the integrand is steep.
      const double rest = 1 - (i + 0.5) / n, xi = 1 - rest * rest;
      const double tangent2 = alpha() * alpha() * xi / (1 - xi);
      const double cosine = 1 / std::sqrt(1 + tangent2), sine = std::sqrt(1 - cosine * cosine);
      for (int j = 0; j < n; ++j) {
        const double phi = 2 * std::numbers::pi * (j + 0.5) / n;
        const dvec3 h(sine * std::cos(phi), sine * std::sin(phi), cosine);
        const double vh = glm::dot(v, h);
        const dvec3 l = 2 * vh * h - v;
        if (vh <= 0 || l.z <= 0) continue;
        add(sum, 2 * rest * fresnel(vh) * smith(v, l) * vh / (v.z * cosine) / (double(n) * n), l);
      }
    }
    return sum;
  }

  double white_sky(double cosine) const {
    const dvec3 v(std::sqrt(1 - cosine * cosine), 0, cosine);
    return diffuse_moments(v).share + specular_moments(v).share;
  }

 private:
  static void add(Moments& sum, double weight, const dvec3& l) {
    sum.share += weight;
    sum.direction += weight * l;
  }
};

}  // namespace octrace::test
