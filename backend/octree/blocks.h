// Memory for a thread's arrays that live until all threads are done.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>

#include "backend/util/huge_array.h"

namespace octrace::octree {

// Arrays in blocks, which last as long as there is an array in them.
template <class T>
class Blocks {
 public:
  using Block = std::shared_ptr<util::HugeArray<T>>;

  // `size`: of blocks; no array may be larger.
  explicit Blocks(std::size_t size) : size_(size) {}

  // Room for as many as may come, of which use() then keeps those that came.
  T* reserve(std::size_t most) {
    if (free_ < most) {
      block_ = std::make_shared<util::HugeArray<T>>(size_, util::kHugePage);
      free_ = size_;
    }
    return block_->data() + (size_ - free_);
  }
  // Returns what keeps them.
  Block use(std::size_t count) {
    free_ -= count;
    return block_;
  }

 private:
  const std::size_t size_;
  Block block_;
  std::size_t free_ = 0;
};

}  // namespace octrace::octree
