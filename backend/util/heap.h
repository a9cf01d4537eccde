// How the C library's heaps grow.
#pragma once

#include <cstddef>

namespace octrace::util {

// From the start what the GNU C library comes to by itself once a large block has been freed:
// blocks of less than 32 MB come from heaps, which keep what is freed. Elsewhere nothing.
void keep_freed_memory();

// After keep_freed_memory(): heaps grow by small pages, a page fault for each, those of other
// threads than the first by a system call for each as well. A thread that is about to take so many
// bytes, less than 32 MB, grows its heap at once, into large pages, which are taken as they are
// touched.
void prepare_heap(std::size_t bytes);

}  // namespace octrace::util
