// How an accessor's elements lie in memory, and reading them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "backend/gltf/tinygltf.h"

namespace octrace::gltf {

struct ElementLayout {
  std::size_t component_bytes = 0;
  std::size_t components = 0;
  std::size_t bytes = 0;         // of an element, with the padding of matrix columns
  std::size_t rows = 0;          // components that lie together
  std::size_t column_bytes = 0;  // from one column to the next
};

// `type` and `component_type` are tinygltf's, from a checked model.
ElementLayout element_layout(int type, int component_type);
ElementLayout element_layout(const tinygltf::Accessor& accessor);

// "VEC3 of FLOAT", for messages.
std::string format_name(int type, int component_type, bool normalized);

// Preconditions for all: the accessor's links have been checked and its buffers are loaded.
void read_floats(const tinygltf::Model& model, int accessor, std::vector<float>& out);
void read_uints(const tinygltf::Model& model, int accessor, std::vector<std::uint32_t>& out);
void read_sparse_indices(const tinygltf::Model& model, int accessor,
                         std::vector<std::uint32_t>& out);

// Without decoding the whole accessor, and without memory for one that has no buffer view.
std::optional<std::size_t> first_not_finite(const tinygltf::Model& model, int accessor);  // element
std::uint32_t largest_uint(const tinygltf::Model& model, int accessor);

}  // namespace octrace::gltf
