#include "backend/util/huge_memory.h"

#include <sys/mman.h>

#include <algorithm>
#include <cstdint>
#include <new>

namespace octrace::util {

namespace {

constexpr std::size_t kSmallPage = 4096;

// A rest of half a huge page and more takes a whole one; small arrays do not take 2 MiB.
std::size_t in_huge_pages(std::size_t bytes) {
  return (bytes + kHugePage / 2) / kHugePage * kHugePage;
}
std::size_t mapped_bytes(std::size_t bytes) {
  return std::max((bytes + kSmallPage - 1) / kSmallPage * kSmallPage, in_huge_pages(bytes));
}

}  // namespace

void* map_huge(std::size_t bytes, std::size_t least) {
  if (bytes > SIZE_MAX / 2) throw std::bad_alloc();
  const std::size_t used = mapped_bytes(bytes);
  void* const memory =
      mmap(nullptr, used + kHugePage, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  auto* const begin = static_cast<std::byte*>(memory);
  const auto address = reinterpret_cast<std::uintptr_t>(begin);
  const std::size_t before = (kHugePage - address % kHugePage) % kHugePage;
  std::byte* const aligned = begin + before;
  // What alignment does not need goes back, so that the size alone says what to unmap.
  if (before != 0) munmap(begin, before);
  munmap(aligned + used, kHugePage - before);
  if (bytes >= least) madvise(aligned, in_huge_pages(bytes), MADV_HUGEPAGE);
  return aligned;
}

void unmap_huge(void* memory, std::size_t bytes) noexcept { munmap(memory, mapped_bytes(bytes)); }

void prefer_huge_pages(void* data, std::size_t bytes) {
  // Whole large pages alone: the rest of the first and the last is other arrays'.
  const auto begin = reinterpret_cast<std::uintptr_t>(data);
  const std::uintptr_t first = (begin + kHugePage - 1) & ~(kHugePage - 1);
  const std::uintptr_t last = (begin + bytes) & ~(kHugePage - 1);
  if (last <= first) return;
  madvise(reinterpret_cast<void*>(first), last - first, MADV_HUGEPAGE);  // may fail without harm
}

}  // namespace octrace::util
