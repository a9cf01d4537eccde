#include "backend/scene/sampler.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace octrace::scene {

namespace {

glm::dquat unit(const glm::dquat& q) {
  const double largest = std::max({std::abs(q.w), std::abs(q.x), std::abs(q.y), std::abs(q.z)});
  if (!(largest > 0.0)) return {1.0, 0.0, 0.0, 0.0};
  const glm::dquat scaled(q.w / largest, q.x / largest, q.y / largest, q.z / largest);
  const double norm = std::sqrt(scaled.w * scaled.w + scaled.x * scaled.x + scaled.y * scaled.y +
                                scaled.z * scaled.z);
  return {scaled.w / norm, scaled.x / norm, scaled.y / norm, scaled.z / norm};
}

// Appendix C.4. Both of unit length.
glm::dquat slerp(const glm::dquat& a, const glm::dquat& b, double share) {
  const double dot = a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z;
  const double angle = std::acos(std::min(std::abs(dot), 1.0));
  const double sine = std::sin(angle);
  double of_a = 1.0 - share, of_b = share;
  // Where the angle is below 1e-8, its sines are in the angles' ratio to the last bit.
  if (sine > 1e-8) {
    of_a = std::sin(angle * (1.0 - share)) / sine;
    of_b = std::sin(angle * share) / sine;
  }
  if (dot < 0.0) of_b = -of_b;
  return unit({of_a * a.w + of_b * b.w, of_a * a.x + of_b * b.x, of_a * a.y + of_b * b.y,
               of_a * a.z + of_b * b.z});
}

}  // namespace

Sampler::Sampler(std::vector<float> keys, std::vector<float> values, Interpolation interpolation)
    : keys_(std::move(keys)), values_(std::move(values)), interpolation_(interpolation) {
  stride_ = values_.size() / keys_.size();
  width_ = interpolation_ == Interpolation::cubic_spline ? stride_ / 3 : stride_;
}

Sampler::Place Sampler::locate(double seconds) const {
  const auto at = static_cast<float>(seconds);
  if (!(at > keys_.front())) return {0, 0.0};
  if (at >= keys_.back()) return {keys_.size() - 1, 0.0};
  const auto next = std::upper_bound(keys_.begin(), keys_.end(), at);
  const auto key = static_cast<std::size_t>(next - keys_.begin()) - 1;
  if (keys_[key] == at) return {key, 0.0};
  const double interval = double{keys_[key + 1]} - double{keys_[key]};
  return {key, std::clamp((seconds - double{keys_[key]}) / interval, 0.0, 1.0), interval};
}

const float* Sampler::key_value(std::size_t key) const {
  const std::size_t before = interpolation_ == Interpolation::cubic_spline ? width_ : 0;
  return values_.data() + key * stride_ + before;
}

bool Sampler::holds(double seconds) const {
  return interpolation_ == Interpolation::step || locate(seconds).share == 0.0;
}

void Sampler::evaluate(double seconds, std::span<double> value) const {
  const Place place = locate(seconds);
  const std::size_t count = std::min(value.size(), width_);
  const float* from = key_value(place.key);
  if (place.share == 0.0 || interpolation_ == Interpolation::step) {
    std::copy_n(from, count, value.begin());
    return;
  }
  const float* to = key_value(place.key + 1);
  const double t = place.share;
  if (interpolation_ == Interpolation::linear) {
    for (std::size_t i = 0; i < count; ++i) value[i] = (1.0 - t) * from[i] + t * to[i];
    return;
  }
  // Appendix C.5: a cubic Hermite spline.
  const float* leaving = from + width_;
  const float* arriving = to - width_;
  const double t2 = t * t, t3 = t2 * t;
  const double of_from = 2.0 * t3 - 3.0 * t2 + 1.0, of_to = 3.0 * t2 - 2.0 * t3;
  const double of_leaving = place.interval * (t3 - 2.0 * t2 + t);
  const double of_arriving = place.interval * (t3 - t2);
  for (std::size_t i = 0; i < count; ++i) {
    value[i] =
        of_from * from[i] + of_leaving * leaving[i] + of_to * to[i] + of_arriving * arriving[i];
  }
}

glm::dquat Sampler::key_rotation(std::size_t key) const {
  const float* q = key_value(key);
  return unit({q[3], q[0], q[1], q[2]});
}

glm::dquat Sampler::evaluate_rotation(double seconds) const {
  if (interpolation_ == Interpolation::linear) {
    const Place place = locate(seconds);
    if (place.share == 0.0) return key_rotation(place.key);
    return slerp(key_rotation(place.key), key_rotation(place.key + 1), place.share);
  }
  double q[4] = {0.0, 0.0, 0.0, 1.0};
  evaluate(seconds, q);
  return unit({q[3], q[0], q[1], q[2]});
}

}  // namespace octrace::scene
