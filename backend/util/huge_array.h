// Large zeroed arrays on huge pages.
#pragma once

#include <cstddef>
#include <type_traits>
#include <utility>

#include "backend/util/huge_memory.h"

namespace octrace::util {

template <class T>
class HugeArray {
  static_assert(std::is_trivial_v<T>);

 public:
  HugeArray() = default;
  // The caller has made sure that the size in bytes fits. `least`: as map_huge() has it.
  explicit HugeArray(std::size_t size, std::size_t least = kLeastInHugePages)
      : data_(size == 0 ? nullptr : static_cast<T*>(map_huge(size * sizeof(T), least))),
        size_(size) {}
  HugeArray(HugeArray&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}
  HugeArray& operator=(HugeArray&& other) noexcept {
    HugeArray moved(std::move(other));
    std::swap(data_, moved.data_);
    std::swap(size_, moved.size_);
    return *this;
  }
  ~HugeArray() {
    if (data_ != nullptr) unmap_huge(data_, size_ * sizeof(T));
  }

  T* data() { return data_; }
  const T* data() const { return data_; }
  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T& operator[](std::size_t i) { return data_[i]; }
  const T& operator[](std::size_t i) const { return data_[i]; }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace octrace::util
