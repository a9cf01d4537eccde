#include "kernels/cuda/status.h"

namespace octrace::kernels::cuda {

Status create_event(Event* event) {
  cudaEvent_t created = nullptr;
  const cudaError_t error = cudaEventCreate(&created);
  *event = created;
  return status_of(error, "creating an event");
}

void destroy_event(Event event) { cudaEventDestroy(static_cast<cudaEvent_t>(event)); }

Status record_event(Event event, Stream stream) {
  return status_of(
      cudaEventRecord(static_cast<cudaEvent_t>(event), static_cast<cudaStream_t>(stream)),
      "recording an event");
}

Status elapsed(Event start, Event stop, float* milliseconds) {
  const Status s = status_of(cudaEventSynchronize(static_cast<cudaEvent_t>(stop)), "tracing");
  if (!s.ok()) return s;
  return status_of(cudaEventElapsedTime(milliseconds, static_cast<cudaEvent_t>(start),
                                        static_cast<cudaEvent_t>(stop)),
                   "reading an event");
}

}  // namespace octrace::kernels::cuda
