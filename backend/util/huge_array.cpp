#include "backend/util/huge_array.h"

#include <sys/mman.h>

#include <algorithm>
#include <cstdint>
#include <new>

namespace octrace::util {

namespace {
constexpr std::size_t kHugePage = std::size_t{2} << 20;
// The system often has small pages at hand and must find or clear large ones: framebuffers of 4 MB
// in large pages made a job of ten views a tenth slower.
constexpr std::size_t kLeastInHugePages = std::size_t{8} << 20;
}  // namespace

HugeMemory::HugeMemory(std::size_t bytes) {
  if (bytes == 0) return;
  if (bytes > SIZE_MAX / 2) throw std::bad_alloc();
  // A rest of half a huge page and more takes a whole one; small arrays do not take 2 MiB.
  const std::size_t huge_bytes = (bytes + kHugePage / 2) / kHugePage * kHugePage;
  mapped_bytes_ = std::max(bytes, huge_bytes) + kHugePage;
  mapped_ =
      mmap(nullptr, mapped_bytes_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (mapped_ == MAP_FAILED) {
    mapped_ = nullptr;
    throw std::bad_alloc();
  }
  const auto address = reinterpret_cast<std::uintptr_t>(mapped_);
  const std::uintptr_t aligned = (address + kHugePage - 1) / kHugePage * kHugePage;
  data_ = reinterpret_cast<void*>(aligned);
  if (bytes >= kLeastInHugePages) madvise(data_, huge_bytes, MADV_HUGEPAGE);  // may be refused
}

HugeMemory::~HugeMemory() {
  if (mapped_ != nullptr) munmap(mapped_, mapped_bytes_);
}

}  // namespace octrace::util
