#include <cstring>

#include "kernels/cuda/status.h"

namespace octrace::kernels::cuda {

Status count_devices(int* count) {
  *count = 0;
  const cudaError_t error = cudaGetDeviceCount(count);
  cudaGetLastError();  // leaves no error behind for the next launch to find
  return status_of(error, "counting devices");
}

Status select_device(int index) { return status_of(cudaSetDevice(index), "selecting the device"); }

Status query_device(int index, Device* device) {
  cudaDeviceProp properties;
  if (Status s = status_of(cudaGetDeviceProperties(&properties, index), "querying the device");
      !s.ok()) {
    return s;
  }
  std::memcpy(device->name, properties.name, sizeof device->name);
  device->major = properties.major;
  device->minor = properties.minor;
  device->multiprocessors = properties.multiProcessorCount;
  std::size_t free_bytes = 0, total_bytes = 0;
  const Status s = status_of(cudaMemGetInfo(&free_bytes, &total_bytes), "querying its memory");
  device->free_bytes = free_bytes;
  device->total_bytes = total_bytes;
  return s;
}

Status allocate(void** memory, std::uint64_t bytes) {
  const cudaError_t error = cudaMalloc(memory, bytes);
  // Out of memory is not sticky, but stays as the last error until it is read.
  if (error != cudaSuccess) cudaGetLastError();
  return status_of(error, "allocating device memory");
}

void release(void* memory) { cudaFree(memory); }

Status allocate_pinned(void** memory, std::uint64_t bytes) {
  const cudaError_t error = cudaMallocHost(memory, bytes);
  if (error != cudaSuccess) cudaGetLastError();
  return status_of(error, "allocating pinned memory");
}

void release_pinned(void* memory) { cudaFreeHost(memory); }

Status pin(void* memory, std::uint64_t bytes) {
  const cudaError_t error = cudaHostRegister(memory, bytes, cudaHostRegisterPortable);
  if (error != cudaSuccess) cudaGetLastError();
  return status_of(error, "locking memory");
}

void unpin(void* memory) {
  if (cudaHostUnregister(memory) != cudaSuccess) cudaGetLastError();
}

Status create_stream(Stream* stream) {
  cudaStream_t created = nullptr;
  const cudaError_t error = cudaStreamCreateWithFlags(&created, cudaStreamNonBlocking);
  *stream = created;
  return status_of(error, "creating a stream");
}

void destroy_stream(Stream stream) { cudaStreamDestroy(static_cast<cudaStream_t>(stream)); }

Status synchronize(Stream stream) {
  return status_of(cudaStreamSynchronize(static_cast<cudaStream_t>(stream)), "tracing");
}

Status copy_to_device(void* to, const void* from, std::uint64_t bytes, Stream stream) {
  return status_of(
      cudaMemcpyAsync(to, from, bytes, cudaMemcpyHostToDevice, static_cast<cudaStream_t>(stream)),
      "copying to the device");
}

Status copy_to_host(void* to, const void* from, std::uint64_t bytes, Stream stream) {
  return status_of(
      cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToHost, static_cast<cudaStream_t>(stream)),
      "copying from the device");
}

Status clear(void* memory, std::uint64_t bytes, Stream stream) {
  return status_of(cudaMemsetAsync(memory, 0, bytes, static_cast<cudaStream_t>(stream)),
                   "clearing device memory");
}

}  // namespace octrace::kernels::cuda
