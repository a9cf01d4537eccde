// Pages of two megabytes for large arrays: the first touch of memory costs a builder more than a
// tenth of its time in pages of four kilobytes.
#pragma once

#include <cstddef>

namespace octrace::util {

// A hint about memory that was not touched yet; small arrays are left alone.
void prefer_huge_pages(void* data, std::size_t bytes);

// Room for `size` elements in large pages, before they are made.
template <class Vector>
void resize_in_huge_pages(Vector& vector, std::size_t size) {
  vector.reserve(size);
  prefer_huge_pages(vector.data(), size * sizeof(typename Vector::value_type));
  vector.resize(size);
}

}  // namespace octrace::util
