#include "backend/util/heap.h"

#include <malloc.h>

#include <cstdlib>

#include "backend/util/huge_memory.h"

namespace octrace::util {

void keep_freed_memory() {
#ifdef __GLIBC__
  // The largest that it takes, and twice as much, as it would choose.
  ::mallopt(M_MMAP_THRESHOLD, 32 << 20);
  ::mallopt(M_TRIM_THRESHOLD, 64 << 20);
#endif
}

void prepare_heap(std::size_t bytes) {
  void* const block = std::malloc(bytes);
  if (block == nullptr) return;
  prefer_huge_pages(block, bytes);
  std::free(block);
}

}  // namespace octrace::util
