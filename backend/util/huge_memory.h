// Memory on huge pages, where the system has them: rays touch a scene's nodes at random, and with
// pages of 4 KiB most of those touches miss the processor's table of pages; and the first touch of
// memory in small pages costs a builder more than a tenth of its time.
#pragma once

#include <cstddef>

namespace octrace::util {

inline constexpr std::size_t kHugePage = std::size_t{2} << 20;

// The system often has small pages at hand and must find or clear large ones: framebuffers of 4 MB
// in large pages made a job of ten views a tenth slower.
inline constexpr std::size_t kLeastInHugePages = std::size_t{8} << 20;

// Fresh memory, which reads as zero, aligned to a huge page, and on huge pages where it is of
// `least` bytes and more. Throws std::bad_alloc. unmap_huge() takes the same size.
void* map_huge(std::size_t bytes, std::size_t least = kLeastInHugePages);
void unmap_huge(void* memory, std::size_t bytes) noexcept;

// A hint about memory of other origin that was not touched yet; small arrays are left alone.
void prefer_huge_pages(void* data, std::size_t bytes);

}  // namespace octrace::util
