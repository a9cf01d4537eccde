// Large zeroed arrays on huge pages, where the system has them: rays touch a scene's nodes at
// random, and with pages of 4 KiB most of those touches miss the processor's table of pages.
#pragma once

#include <cstddef>
#include <type_traits>
#include <utility>

namespace octrace::util {

// Zeroed memory of at least `bytes`, aligned to a huge page. Throws std::bad_alloc.
class HugeMemory {
 public:
  HugeMemory() = default;
  explicit HugeMemory(std::size_t bytes);
  HugeMemory(HugeMemory&& other) noexcept { swap(other); }
  HugeMemory& operator=(HugeMemory&& other) noexcept {
    swap(other);
    return *this;
  }
  ~HugeMemory();

  void* data() const { return data_; }

 private:
  void swap(HugeMemory& other) {
    std::swap(mapped_, other.mapped_);
    std::swap(mapped_bytes_, other.mapped_bytes_);
    std::swap(data_, other.data_);
  }

  void* mapped_ = nullptr;
  std::size_t mapped_bytes_ = 0;
  void* data_ = nullptr;
};

template <class T>
class HugeArray {
  static_assert(std::is_trivial_v<T>);

 public:
  HugeArray() = default;
  // The caller has made sure that the size in bytes fits.
  explicit HugeArray(std::size_t size) : memory_(size * sizeof(T)), size_(size) {}
  HugeArray(HugeArray&& other) noexcept
      : memory_(std::move(other.memory_)), size_(std::exchange(other.size_, 0)) {}
  HugeArray& operator=(HugeArray&& other) noexcept {
    memory_ = std::move(other.memory_);
    size_ = std::exchange(other.size_, 0);
    return *this;
  }

  T* data() { return static_cast<T*>(memory_.data()); }
  const T* data() const { return static_cast<const T*>(memory_.data()); }
  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T& operator[](std::size_t i) { return data()[i]; }
  const T& operator[](std::size_t i) const { return data()[i]; }

 private:
  HugeMemory memory_;
  std::size_t size_ = 0;
};

}  // namespace octrace::util
