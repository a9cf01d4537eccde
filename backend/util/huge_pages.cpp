#include "backend/util/huge_pages.h"

#include <sys/mman.h>

#include <cstdint>

namespace octrace::util {

void prefer_huge_pages(void* data, std::size_t bytes) {
  constexpr std::uintptr_t kPage = std::uintptr_t{2} << 20;
  // Whole large pages alone: the rest of the first and the last is other arrays'.
  const auto begin = reinterpret_cast<std::uintptr_t>(data);
  const std::uintptr_t first = (begin + kPage - 1) & ~(kPage - 1);
  const std::uintptr_t last = (begin + bytes) & ~(kPage - 1);
  if (last <= first) return;
  madvise(reinterpret_cast<void*>(first), last - first, MADV_HUGEPAGE);  // may fail without harm
}

}  // namespace octrace::util
