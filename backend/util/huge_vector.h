// A std::vector that is on huge pages from one of them on, and whose new elements are left as they
// are: threads that fill a large array touch its pages first, each its own.
#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <new>
#include <type_traits>
#include <utility>
#include <vector>

#include "backend/util/huge_memory.h"

namespace octrace::util {

template <class T>
struct HugeAllocator {
  static_assert(std::is_trivially_default_constructible_v<T> && std::is_trivially_copyable_v<T>);
  using value_type = T;

  HugeAllocator() = default;
  template <class U>
  HugeAllocator(const HugeAllocator<U>&) noexcept {}

  T* allocate(std::size_t size) {
    if (size > std::numeric_limits<std::size_t>::max() / sizeof(T)) throw std::bad_alloc();
    const std::size_t bytes = size * sizeof(T);
    return static_cast<T*>(bytes < kHugePage ? ::operator new (bytes, std::align_val_t{alignof(T)})
                                             : map_huge(bytes, kHugePage));
  }
  void deallocate(T* memory, std::size_t size) noexcept {
    const std::size_t bytes = size * sizeof(T);
    if (bytes < kHugePage) {
      ::operator delete (memory, std::align_val_t{alignof(T)});
    } else {
      unmap_huge(memory, bytes);
    }
  }

  // resize() leaves elements uninitialised; all else as usual.
  template <class U>
  void construct(U* at) noexcept {
    ::new (static_cast<void*>(at)) U;
  }
  template <class U, class... Args>
  void construct(U* at, Args&&... args) {
    std::construct_at(at, std::forward<Args>(args)...);
  }

  template <class U>
  bool operator==(const HugeAllocator<U>&) const noexcept {
    return true;
  }
};

template <class T>
using HugeVector = std::vector<T, HugeAllocator<T>>;

}  // namespace octrace::util
