// How the C library's heaps grow.
#pragma once

#include <cstddef>

namespace octrace::util {

// From the start what the GNU C library comes to by itself once a large block has been freed:
// blocks of less than 32 MB come from heaps, which keep what is freed. Elsewhere nothing.
void keep_freed_memory();

// The heap of a thread other than the first grows by a page at a time, a system call and a page
// fault for each. A thread that is about to take so many bytes in small pieces grows it at once,
// into large pages.
void prepare_thread_heap(std::size_t bytes);

}  // namespace octrace::util
