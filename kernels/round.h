// Arithmetic that rounds exactly once an operation, on every compiler and device. The triangle test
// is written with these, so that CPU and GPU agree on every bit. (The rest of the kernels rely on
// the build's -ffp-contract=off and --fmad=false.)
#pragma once

#include "kernels/config.h"

namespace octrace::kernels {

#if defined(__CUDA_ARCH__)
OCTRACE_HD OCTRACE_FORCE_INLINE float add_rn(float a, float b) { return __fadd_rn(a, b); }
OCTRACE_HD OCTRACE_FORCE_INLINE float sub_rn(float a, float b) { return __fsub_rn(a, b); }
OCTRACE_HD OCTRACE_FORCE_INLINE float mul_rn(float a, float b) { return __fmul_rn(a, b); }
OCTRACE_HD OCTRACE_FORCE_INLINE float div_rn(float a, float b) { return __fdiv_rn(a, b); }
OCTRACE_HD OCTRACE_FORCE_INLINE float reciprocal_rn(float a) { return __frcp_rn(a); }
OCTRACE_HD OCTRACE_FORCE_INLINE float fma_rn(float a, float b, float c) {
  return __fmaf_rn(a, b, c);
}
OCTRACE_HD OCTRACE_FORCE_INLINE double sub_rn(double a, double b) { return __dsub_rn(a, b); }
OCTRACE_HD OCTRACE_FORCE_INLINE double mul_rn(double a, double b) { return __dmul_rn(a, b); }
#else
OCTRACE_HD OCTRACE_FORCE_INLINE float add_rn(float a, float b) { return a + b; }
OCTRACE_HD OCTRACE_FORCE_INLINE float sub_rn(float a, float b) { return a - b; }
OCTRACE_HD OCTRACE_FORCE_INLINE float mul_rn(float a, float b) { return a * b; }
OCTRACE_HD OCTRACE_FORCE_INLINE float div_rn(float a, float b) { return a / b; }
OCTRACE_HD OCTRACE_FORCE_INLINE float reciprocal_rn(float a) { return 1.0f / a; }
// One instruction where the function it is inlined into is compiled for FMA, else libm's.
OCTRACE_HD OCTRACE_FORCE_INLINE float fma_rn(float a, float b, float c) {
  return __builtin_fmaf(a, b, c);
}
OCTRACE_HD OCTRACE_FORCE_INLINE double sub_rn(double a, double b) { return a - b; }
OCTRACE_HD OCTRACE_FORCE_INLINE double mul_rn(double a, double b) { return a * b; }
#endif

OCTRACE_HD OCTRACE_FORCE_INLINE float lesser(float a, float b) { return a < b ? a : b; }
OCTRACE_HD OCTRACE_FORCE_INLINE float greater(float a, float b) { return a > b ? a : b; }
// The same for numbers, in one instruction everywhere; which of +0 and -0 is the lesser is left
// open.
#if defined(__CUDA_ARCH__)
OCTRACE_HD OCTRACE_FORCE_INLINE float least(float a, float b) { return fminf(a, b); }
OCTRACE_HD OCTRACE_FORCE_INLINE float most(float a, float b) { return fmaxf(a, b); }
#else
OCTRACE_HD OCTRACE_FORCE_INLINE float least(float a, float b) { return lesser(a, b); }
OCTRACE_HD OCTRACE_FORCE_INLINE float most(float a, float b) { return greater(a, b); }
#endif
OCTRACE_HD OCTRACE_FORCE_INLINE float abs_of(float a) { return __builtin_fabsf(a); }

}  // namespace octrace::kernels
