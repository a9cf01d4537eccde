// Device and pinned host memory that frees itself, and streams and events that do.
#pragma once

#include <cstdint>
#include <utility>

#include "backend/util/result.h"
#include "kernels/cuda/cuda.h"

namespace octrace::render {

// A CUDA failure that is not about memory: exit 7, with CUDA's own words.
util::Error cuda_error(const kernels::cuda::Status& status);

template <kernels::cuda::Status (*kAllocate)(void**, std::uint64_t), void (*kRelease)(void*)>
class Memory {
 public:
  Memory() = default;
  Memory(Memory&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)), bytes_(std::exchange(other.bytes_, 0)) {}
  Memory& operator=(Memory&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  ~Memory() {
    if (data_ != nullptr) kRelease(data_);
  }

  // At least `bytes` bytes; what was there before is lost only when more is needed.
  kernels::cuda::Status reserve(std::uint64_t bytes) {
    if (bytes <= bytes_) return {};
    if (data_ != nullptr) kRelease(std::exchange(data_, nullptr));
    bytes_ = 0;
    const kernels::cuda::Status status = kAllocate(&data_, bytes);
    if (status.ok()) bytes_ = bytes;
    return status;
  }
  void* data() const { return data_; }
  std::uint64_t bytes() const { return bytes_; }

 private:
  void* data_ = nullptr;
  std::uint64_t bytes_ = 0;
};

using DeviceMemory = Memory<kernels::cuda::allocate, kernels::cuda::release>;
using PinnedMemory = Memory<kernels::cuda::allocate_pinned, kernels::cuda::release_pinned>;

class DeviceStream {
 public:
  DeviceStream() = default;
  DeviceStream(const DeviceStream&) = delete;
  DeviceStream& operator=(const DeviceStream&) = delete;
  ~DeviceStream() {
    if (stream_ != nullptr) kernels::cuda::destroy_stream(stream_);
  }
  kernels::cuda::Status create() { return kernels::cuda::create_stream(&stream_); }
  kernels::cuda::Stream get() const { return stream_; }

 private:
  kernels::cuda::Stream stream_ = nullptr;
};

class DeviceEvent {
 public:
  DeviceEvent() = default;
  DeviceEvent(const DeviceEvent&) = delete;
  DeviceEvent& operator=(const DeviceEvent&) = delete;
  ~DeviceEvent() {
    if (event_ != nullptr) kernels::cuda::destroy_event(event_);
  }
  kernels::cuda::Status create() { return kernels::cuda::create_event(&event_); }
  kernels::cuda::Event get() const { return event_; }

 private:
  kernels::cuda::Event event_ = nullptr;
};

}  // namespace octrace::render
