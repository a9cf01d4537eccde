// Sine, cosine and random numbers from additions and multiplications alone, so that built-in scenes
// have the same bits whatever C library they run on.
#pragma once

#include <cmath>
#include <cstdint>

namespace octrace::scene {

struct SinCos {
  double sin, cos;
};

// Of an angle in turns (1: full circle). Error below 1e-15: the series end where the next term at
// an eighth of a turn, (pi/4)^17/17! and (pi/4)^18/18!, is below 1e-16.
inline SinCos sin_cos_turns(double turns) {
  constexpr double kTau = 6.283185307179586476925286766559;
  const double quarters = std::floor(turns * 4.0 + 0.5);  // the nearest quarter turn
  const double angle = (turns - quarters * 0.25) * kTau;
  const double x2 = angle * angle;
  double sine = 1.0, cosine = 1.0;
  for (int k = 15; k >= 3; k -= 2) sine = 1.0 - sine * x2 / ((k - 1) * k);
  for (int k = 16; k >= 2; k -= 2) cosine = 1.0 - cosine * x2 / ((k - 1) * k);
  sine *= angle;
  switch (static_cast<std::int64_t>(quarters) & 3) {
    case 0:
      return {sine, cosine};
    case 1:
      return {cosine, -sine};
    case 2:
      return {-sine, -cosine};
    default:
      return {-cosine, sine};
  }
}

// A permutation of 32-bit numbers whose bits depend on all bits of the argument (the finaliser of
// MurmurHash3).
inline std::uint32_t hash32(std::uint32_t x) {
  x ^= x >> 16;
  x *= 0x85ebca6bu;
  x ^= x >> 13;
  x *= 0xc2b2ae35u;
  return x ^ (x >> 16);
}

// Counter-based: the n-th number of a stream, in [0, 1).
inline double uniform(std::uint32_t stream, std::uint32_t n) {
  return hash32(hash32(stream * 0x9e3779b9u + 0x7f4a7c15u) ^ (n * 0x85157af5u + 0x1b873593u)) *
         0x1p-32;
}

}  // namespace octrace::scene
