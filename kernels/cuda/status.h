// cudaError_t -> Status. For the .cu files only.
#pragma once

#include <cuda_runtime.h>

#include "kernels/cuda/cuda.h"

namespace octrace::kernels::cuda {

inline Status status_of(cudaError_t error, const char* call) {
  if (error == cudaSuccess) return {};
  return {static_cast<int>(error), cudaGetErrorName(error), cudaGetErrorString(error), call};
}

// A launch reports a bad configuration, or an earlier launch's failure, only when asked.
inline Status launch_status(const char* call) { return status_of(cudaGetLastError(), call); }

}  // namespace octrace::kernels::cuda
