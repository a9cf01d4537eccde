// The one macro and the few types that every kernel header needs. Kernels compile as plain C++ and
// as CUDA from the same text: no allocation, no I/O, no exceptions, no std containers.
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#if defined(__CUDACC__)
#define OCTRACE_HD __host__ __device__
#define OCTRACE_FORCE_INLINE __forceinline__
#else
#define OCTRACE_HD
#define OCTRACE_FORCE_INLINE inline __attribute__((always_inline))
#endif

namespace octrace::kernels {

using Vec2 = glm::vec2;
using Vec3 = glm::vec3;
using Vec4 = glm::vec4;

inline constexpr std::uint32_t kNone = 0xffffffffu;  // "no such index" wherever an index is stored

// A read-only array in host or device memory.
template <class T>
struct Span {
  const T* data = nullptr;
  std::uint64_t size = 0;
  OCTRACE_HD const T& operator[](std::uint64_t i) const { return data[i]; }
  OCTRACE_HD bool empty() const { return size == 0; }
};

}  // namespace octrace::kernels
