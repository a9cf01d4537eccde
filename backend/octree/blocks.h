// Memory for a thread's arrays that live until all threads are done.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

namespace octrace::octree {

// Elements stay where they are. Blocks are of `kSize`, which no array may exceed.
template <class T, std::size_t kSize>
class Blocks {
 public:
  // Room for as many as may come, of which use() then keeps those that came.
  T* reserve(std::size_t most) {
    if (free_ < most) {
      blocks_.push_back(std::make_unique_for_overwrite<T[]>(kSize));
      free_ = kSize;
    }
    return blocks_.back().get() + (kSize - free_);
  }
  void use(std::size_t count) { free_ -= count; }

 private:
  std::vector<std::unique_ptr<T[]>> blocks_;
  std::size_t free_ = 0;  // of the last block
};

}  // namespace octrace::octree
