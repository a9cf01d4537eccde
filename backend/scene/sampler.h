// One sampler of a glTF animation: key times and values, and what lies between them (glTF 2.0,
// 3.11 and appendix C).
#pragma once

#include <glm/gtc/quaternion.hpp>
#include <span>
#include <vector>

#include "backend/gltf/document.h"

namespace octrace::scene {

enum class Interpolation { step, linear, cubic_spline };

// Before the first and after the last key the value is that key's. A time that is a key's once it
// is rounded to float, as key times are, is at that key: frame / fps in double may fall short of
// the key that an exporter wrote for that frame.
class Sampler {
 public:
  // keys: ascending, at least one. values: `width` numbers a key, for cubic splines 3 * width: the
  // in-tangent, the value, the out-tangent; tangents are per second.
  Sampler(std::vector<float> keys, std::vector<float> values, Interpolation interpolation);

  std::size_t width() const { return width_; }
  double start() const { return keys_.front(); }
  double end() const { return keys_.back(); }
  std::span<const float> keys() const { return keys_; }
  // At a key, or where a key's value is held: before the first, after the last, between steps.
  bool holds(double seconds) const;

  // As many numbers as `value` has room for, at most width().
  void evaluate(double seconds, std::span<double> value) const;

  // Of a sampler of width 4 (x y z w): linear keys along the shorter arc at constant speed; always
  // of unit length.
  glm::dquat evaluate_rotation(double seconds) const;

 private:
  struct Place {
    std::size_t key;        // the last one not after the time
    double share;           // of the way to the next key, in [0, 1]; 0: at the key
    double interval = 0.0;  // seconds to the next key
  };
  Place locate(double seconds) const;
  const float* key_value(std::size_t key) const;
  glm::dquat key_rotation(std::size_t key) const;

  std::vector<float> keys_, values_;
  Interpolation interpolation_;
  std::size_t width_, stride_;  // numbers a value, numbers a key
};

}  // namespace octrace::scene
