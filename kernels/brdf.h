// glTF 2.0's metallic-roughness BRDF (specification, appendix B.3): Lambert under a GGX layer with
// Schlick's Fresnel term. Masking and shadowing are height-correlated Smith (Heitz 2014), as in
// Khronos' sample renderer.
#pragma once

#include "kernels/sample.h"
#include "kernels/vector_math.h"

namespace octrace::kernels {

// Below this the highlight of a point light is smaller than float can resolve (Lagarde and
// de Rousiers 2014 clamp likewise); a mirror stays one to the eye.
inline constexpr float kMinRoughness = 0.045f;

struct Brdf {
  Vec3 diffuse;  // Lambert albedo
  Vec3 f0;       // reflectance at normal incidence
  float alpha;   // roughness squared
};

OCTRACE_HD inline Brdf make_brdf(Vec3 base_color, float metallic, float roughness) {
  const float m = clamp01(metallic);
  const float r = greater(clamp01(roughness), kMinRoughness);
  const Vec3 f0 = Vec3(0.04f) + m * (base_color - Vec3(0.04f));
  return {(1.0f - m) * base_color, {clamp01(f0.x), clamp01(f0.y), clamp01(f0.z)}, r * r};
}

OCTRACE_HD inline Vec3 fresnel(Vec3 f0, float v_dot_h) {
  const float m = 1.0f - clamp01(v_dot_h);
  const float m2 = m * m;
  return f0 + (m2 * m2 * m) * (Vec3(1.0f) - f0);
}

// G / (4 n_dot_l n_dot_v).
OCTRACE_HD inline float smith_visibility(float alpha, float n_dot_l, float n_dot_v) {
  const float a2 = alpha * alpha;
  const float l = n_dot_v * square_root(n_dot_l * n_dot_l * (1.0f - a2) + a2);
  const float v = n_dot_l * square_root(n_dot_v * n_dot_v * (1.0f - a2) + a2);
  return 0.5f / (l + v);
}

// BRDF times the cosine of the light's angle. All vectors are unit; n_dot_v must be positive.
OCTRACE_HD inline Vec3 evaluate_brdf(const Brdf& brdf, Vec3 n, Vec3 v, Vec3 l) {
  const float n_dot_l = dot(n, l), n_dot_v = dot(n, v);
  if (!(n_dot_l > 0.0f) || !(n_dot_v > 0.0f)) return Vec3(0.0f);
  const Vec3 h = normalize_or(v + l, n);
  const Vec3 f = fresnel(brdf.f0, dot(v, h));
  // 1 - (n.h)^2 as |n x h|^2, which does not cancel at the highlight's centre.
  const Vec3 nxh = cross(n, h);
  const float n_dot_h = dot(n, h), a2 = brdf.alpha * brdf.alpha;
  const float lobe = dot(nxh, nxh) + a2 * n_dot_h * n_dot_h;
  const float distribution = a2 / (kPi * lobe * lobe);
  const Vec3 specular = f * (distribution * smith_visibility(brdf.alpha, n_dot_l, n_dot_v));
  const Vec3 diffuse = (Vec3(1.0f) - f) * brdf.diffuse * (1.0f / kPi);
  return n_dot_l * (diffuse + specular);
}

struct BrdfSample {
  Vec3 direction;  // unit, world
  Vec3 weight;     // BRDF * cosine / density; 0: no light comes this way
};

OCTRACE_HD inline BrdfSample sample_diffuse(const Brdf& brdf, const Basis& basis, Vec3 v,
                                            Vec2 uniform) {
  const Vec3 l = normalize_or(basis.to_world(sample_cosine(uniform)), basis.z);
  const Vec3 h = normalize_or(v + l, basis.z);
  return {l, (Vec3(1.0f) - fresnel(brdf.f0, dot(v, h))) * brdf.diffuse};
}

// Visible normals of GGX (Heitz 2018, JCGT 7(4)).
OCTRACE_HD inline BrdfSample sample_specular(const Brdf& brdf, const Basis& basis, Vec3 v,
                                             Vec2 uniform) {
  const Vec3 local = basis.to_local(v);
  const float alpha = brdf.alpha, a2 = alpha * alpha;
  const Vec3 up(0.0f, 0.0f, 1.0f);
  const Vec3 vh = normalize_or({alpha * local.x, alpha * local.y, local.z}, up);
  const Vec3 t1 = normalize_or({-vh.y, vh.x, 0.0f}, {1.0f, 0.0f, 0.0f});
  const Vec3 t2 = cross(vh, t1);
  Vec2 p = sample_disk(uniform);
  const float s = 0.5f * (1.0f + vh.z);
  p.y = (1.0f - s) * square_root(greater(1.0f - p.x * p.x, 0.0f)) + s * p.y;
  const Vec3 nh = p.x * t1 + p.y * t2 + square_root(greater(1.0f - dot(p, p), 0.0f)) * vh;
  const Vec3 h = normalize_or({alpha * nh.x, alpha * nh.y, greater(nh.z, 0.0f)}, up);
  const float v_dot_h = dot(local, h);
  const Vec3 l = 2.0f * v_dot_h * h - local;
  if (!(l.z > 0.0f) || !(local.z > 0.0f)) return {basis.z, Vec3(0.0f)};
  const float g1 = 2.0f * local.z / (local.z + square_root(local.z * local.z * (1.0f - a2) + a2));
  const float g2 = 4.0f * l.z * local.z * smith_visibility(alpha, l.z, local.z);
  return {normalize_or(basis.to_world(l), basis.z), (g2 / g1) * fresnel(brdf.f0, v_dot_h)};
}

}  // namespace octrace::kernels
