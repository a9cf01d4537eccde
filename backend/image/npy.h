// NumPy's array files: .npy holds one array, .npz is a ZIP archive of them (NumPy's NEP 1, format
// version 1.0). Needs no image library. C order, little-endian.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "backend/image/zip.h"
#include "backend/util/result.h"

namespace octrace::image {

enum class ArrayType { float32, uint32, boolean };  // boolean: a byte each, 0 or 1

struct Array {
  std::string name;  // np.load(FILE)[name]; not used by .npy
  ArrayType type = ArrayType::float32;
  std::vector<std::uint64_t> shape;
  const void* data = nullptr;  // contiguous, the product of shape times 4 bytes (boolean: 1)
};

// Whole or absent (backend/util/atomic_file.h). Exit 5 where writing fails.
util::Result<void> write_npy(const std::string& path, const Array& array);
// Stored, as numpy.savez does, or deflated, as numpy.savez_compressed.
util::Result<void> write_npz(const std::string& path, std::span<const Array> arrays,
                             Packing packing);

}  // namespace octrace::image
