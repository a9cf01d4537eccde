// Which objects a view shows, where and how large, out of its object_id plane.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace octrace::batch {

struct ViewObject {
  std::uint32_t id = 0;      // as in the plane; never 0, the background
  std::uint64_t pixels = 0;  // at least 1
  // First and last column and row that hold a pixel of it.
  std::uint32_t left = 0, top = 0, right = 0, bottom = 0;
  std::string rle;  // compressed run lengths (run_length.h), where asked for
};

// By id. One pass over the plane, rows from the top; masks take a second one over its columns.
std::vector<ViewObject> find_objects(std::span<const std::uint32_t> ids, std::uint32_t width,
                                     std::uint32_t height, bool masks);

}  // namespace octrace::batch
