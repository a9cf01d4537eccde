// Samplers against values worked out by hand from the specification's formulas.
#include "backend/scene/sampler.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace octrace::scene {
namespace {

double one(const Sampler& sampler, double seconds) {
  double value = -1.0;
  sampler.evaluate(seconds, {&value, 1});
  return value;
}

TEST(Sampler, StepsHoldEachKeyUntilTheNext) {
  const Sampler sampler({1.0f, 2.0f, 4.0f}, {10.0f, 20.0f, 40.0f}, Interpolation::step);
  EXPECT_EQ(one(sampler, 0.0), 10.0);
  EXPECT_EQ(one(sampler, 1.0), 10.0);
  EXPECT_EQ(one(sampler, 1.999), 10.0);
  EXPECT_EQ(one(sampler, 2.0), 20.0);
  EXPECT_EQ(one(sampler, 3.999), 20.0);
  EXPECT_EQ(one(sampler, 4.0), 40.0);
  EXPECT_EQ(one(sampler, 1e30), 40.0);
}

TEST(Sampler, LinearIsHeldOutsideItsKeys) {
  const Sampler sampler({1.0f, 2.0f, 4.0f}, {10.0f, 20.0f, 40.0f}, Interpolation::linear);
  EXPECT_EQ(one(sampler, -1.0), 10.0);
  EXPECT_EQ(one(sampler, 1.25), 12.5);
  EXPECT_EQ(one(sampler, 3.5), 35.0);
  EXPECT_EQ(one(sampler, 100.0), 40.0);
  EXPECT_EQ(one(sampler, std::numeric_limits<double>::infinity()), 40.0);
}

TEST(Sampler, OneKeyIsAConstant) {
  const Sampler sampler({1.0f}, {7.0f}, Interpolation::linear);
  for (const double t : {-1.0, 0.0, 1.0, 2.0}) EXPECT_EQ(one(sampler, t), 7.0);
}

// Frame n of an exporter's key is float(n / fps); the same frame asked for in double may lie
// before.
TEST(Sampler, AFrameIsItsKeyWhateverRoundsBetween) {
  for (const double fps : {24.0, 25.0, 29.97, 30.0, 60.0}) {
    std::vector<float> keys, values;
    for (int frame = 0; frame < 500; ++frame) {
      keys.push_back(static_cast<float>(frame / fps));
      values.push_back(static_cast<float>(frame));
    }
    const Sampler sampler(keys, values, Interpolation::step);
    for (int frame = 0; frame < 500; ++frame) {
      ASSERT_EQ(one(sampler, frame / fps), frame) << "at " << fps << " fps";
    }
  }
}

// The tangents are per second: the interval scales them. With values v(t) of a cubic polynomial and
// its derivative for tangents the spline is that polynomial.
TEST(Sampler, ASplineThroughACubicIsThatCubic) {
  const auto v = [](double t) { return 2.0 - 3.0 * t + 0.5 * t * t + 0.25 * t * t * t; };
  const auto dv = [](double t) { return -3.0 + t + 0.75 * t * t; };
  std::vector<float> keys{0.0f, 0.5f, 2.0f, 5.0f}, values;
  for (const float t : keys) {
    for (const double x : {dv(t), v(t), dv(t)}) values.push_back(static_cast<float>(x));
  }
  const Sampler sampler(keys, values, Interpolation::cubic_spline);
  EXPECT_EQ(sampler.width(), 1u);
  for (double t = 0.0; t <= 5.0; t += 0.01) ASSERT_NEAR(one(sampler, t), v(t), 1e-5) << t;
  EXPECT_EQ(one(sampler, -1.0), v(0.0));
  EXPECT_EQ(one(sampler, 9.0), static_cast<float>(v(5.0)));
}

// The in-tangent of the first key and the out-tangent of the last one are never looked at, and each
// side of a key has its own.
TEST(Sampler, ASplineUsesTheTangentsThatFaceTheInterval) {
  const float wild = 1e9f;
  const Sampler sampler({0.0f, 2.0f, 4.0f},
                        {wild, 0.0f, 1.0f, 0.5f, 4.0f, -2.0f, 0.25f, 0.0f, wild},
                        Interpolation::cubic_spline);
  // u = 1/2: (v0 + v1) / 2 + d (b0 - a1) / 8
  EXPECT_NEAR(one(sampler, 1.0), 2.0 + 2.0 * (1.0 - 0.5) / 8.0, 1e-12);
  EXPECT_NEAR(one(sampler, 3.0), 2.0 + 2.0 * (-2.0 - 0.25) / 8.0, 1e-12);
}

glm::dquat about_z(double radians) {
  return {std::cos(radians / 2), 0.0, 0.0, std::sin(radians / 2)};
}
std::vector<float> xyzw(std::initializer_list<glm::dquat> rotations) {
  std::vector<float> values;
  for (const glm::dquat& q : rotations) {
    for (const double x : {q.x, q.y, q.z, q.w}) values.push_back(static_cast<float>(x));
  }
  return values;
}
double angle_z(const glm::dquat& q) {
  const double turn = 2.0 * std::atan2(q.z, q.w);
  return std::remainder(turn, 2.0 * M_PI);
}

TEST(Sampler, RotationsTurnAtConstantSpeed) {
  const Sampler sampler({0.0f, 1.0f}, xyzw({about_z(0.2), about_z(3.0)}), Interpolation::linear);
  for (double t = 0.0; t <= 1.0; t += 0.125) {
    const glm::dquat q = sampler.evaluate_rotation(t);
    ASSERT_NEAR(angle_z(q), 0.2 + t * 2.8, 1e-6);
    ASSERT_NEAR(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z, 1.0, 1e-14);
  }
}

TEST(Sampler, RotationsTakeTheShorterArc) {
  const Sampler sampler({0.0f, 1.0f}, xyzw({about_z(0.2), about_z(0.2 + 2.0 * M_PI - 1.0)}),
                        Interpolation::linear);
  EXPECT_NEAR(angle_z(sampler.evaluate_rotation(0.5)), 0.2 - 0.5, 1e-6);
  const Sampler negated({0.0f, 1.0f}, xyzw({about_z(0.2), -about_z(0.8)}), Interpolation::linear);
  EXPECT_NEAR(angle_z(negated.evaluate_rotation(0.5)), 0.5, 1e-6);
}

TEST(Sampler, EqualRotationsStayPut) {
  const Sampler sampler({0.0f, 1.0f}, xyzw({about_z(1.0), about_z(1.0)}), Interpolation::linear);
  EXPECT_NEAR(angle_z(sampler.evaluate_rotation(0.3)), 1.0, 1e-7);
}

TEST(Sampler, RotationsAreMadeUnitAndZeroIsNone) {
  const Sampler sampler({0.0f, 1.0f}, {0, 0, 0, 0, 0, 0, 3.0f, 3.0f}, Interpolation::step);
  const glm::dquat none = sampler.evaluate_rotation(0.0);
  EXPECT_EQ(none.w, 1.0);
  EXPECT_NEAR(angle_z(sampler.evaluate_rotation(1.0)), M_PI / 2, 1e-12);
}

TEST(Sampler, SplinesOfRotationsAreUnit) {
  std::vector<float> values;
  for (const glm::dquat& q : {about_z(0.0), about_z(2.0)}) {
    values.insert(values.end(), {0.3f, 0.0f, 0.1f, 0.0f});
    for (const double x : {q.x, q.y, q.z, q.w}) values.push_back(static_cast<float>(x));
    values.insert(values.end(), {0.2f, 0.0f, 0.5f, -0.5f});
  }
  const Sampler sampler({0.0f, 1.0f}, values, Interpolation::cubic_spline);
  for (double t = 0.0; t <= 1.0; t += 0.1) {
    const glm::dquat q = sampler.evaluate_rotation(t);
    ASSERT_NEAR(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z, 1.0, 1e-14);
  }
}

}  // namespace
}  // namespace octrace::scene
