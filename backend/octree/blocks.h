// Memory for a thread's arrays, which others need later.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>

#include "backend/util/huge_array.h"

namespace octrace::octree {

// Arrays in blocks, which last as long as somebody keeps an array in them.
template <class T>
class Blocks {
 public:
  using Block = std::shared_ptr<util::HugeArray<T>>;

  // `size`: of blocks; a larger array has one of its own.
  explicit Blocks(std::size_t size) : size_(size) {}

  // Room for as many as may come, of which use() then keeps those that came.
  T* reserve(std::size_t most) {
    if (free_ < most) {
      free_ = std::max(size_, most);
      block_ = std::make_shared<util::HugeArray<T>>(free_, util::kHugePage);
    }
    return block_->data() + (block_->size() - free_);
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
