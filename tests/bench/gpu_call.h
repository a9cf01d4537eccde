// CUDA's answers as the bench's errors.
#pragma once

#include <fmt/format.h>

#include "backend/render/device_memory.h"
#include "kernels/cuda/cuda.h"

namespace octrace::bench {

// What a launch reported beside its hits, read back; an error where a ray failed.
inline util::Result<void> check_report(const render::DeviceMemory& report) {
  kernels::cuda::Report host{};
  kernels::cuda::Status s = kernels::cuda::copy_to_host(&host, report.data(), sizeof host, nullptr);
  if (s.ok()) s = kernels::cuda::synchronize(nullptr);
  if (!s.ok()) return render::cuda_error(s);
  if (host.status == 0) return {};
  return util::Error{
      util::Exit::internal, "",
      fmt::format("tracing failed at {}, {} with status {}", host.x, host.y, host.status), "", ""};
}

// The first failure of a row of calls; later calls of the row are left out.
class CudaCalls {
 public:
  template <class Call>
  CudaCalls& then(Call&& call) {
    if (status_.ok()) status_ = call();
    return *this;
  }
  bool ok() const { return status_.ok(); }
  util::Error error() const { return render::cuda_error(status_); }

 private:
  kernels::cuda::Status status_;
};

template <class T, class Allocator>
kernels::cuda::Status upload(render::DeviceMemory& memory,
                             const std::vector<T, Allocator>& values) {
  if (values.empty()) return {};
  const std::uint64_t bytes = values.size() * sizeof(T);
  if (kernels::cuda::Status s = memory.reserve(bytes); !s.ok()) return s;
  return kernels::cuda::copy_to_device(memory.data(), values.data(), bytes, nullptr);
}

template <class T, class Allocator>
kernels::Span<T> span_of(const render::DeviceMemory& memory,
                         const std::vector<T, Allocator>& values) {
  return {static_cast<const T*>(memory.data()), values.size()};
}

inline util::Result<std::string> use_device(int index) {
  kernels::cuda::Device device{};
  CudaCalls calls;
  calls.then([&] { return kernels::cuda::query_device(index, &device); }).then([&] {
    return kernels::cuda::select_device(index);
  });
  if (!calls.ok()) return calls.error();
  return std::string(device.name);
}

}  // namespace octrace::bench
