// A glTF 2.0 file that has been read and validated: after load() succeeds, every index, size, type
// and value that later stages use is known to be in range.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "backend/gltf/tinygltf.h"
#include "backend/util/limits.h"
#include "backend/util/result.h"

namespace octrace::gltf {

// An image as it lies in the file, not decoded; its header has been checked.
struct EncodedImage {
  std::vector<std::uint8_t> bytes;  // empty: missing, and LoadOptions said to go on
  std::string mime;                 // image/png, image/jpeg or image/webp, by content
  std::string pointer;              // "/images/3"
  std::string uri;                  // as the file names it; empty where embedded
};

struct Document {
  tinygltf::Model model;  // structure only: its images hold no pixels
  std::vector<EncodedImage> images;
  std::string file;  // as the user named it
  std::vector<std::string> warnings;

  // Element counts come from model.accessors[i].count.
  // Components as float, normalised integers mapped to [0,1] or [-1,1], sparse values applied,
  // strides followed: count * components numbers, in order.
  std::vector<float> read_floats(int accessor) const;
  // Unsigned integer scalars or vectors (indices, joints), sparse values applied.
  std::vector<std::uint32_t> read_uints(int accessor) const;
};

struct LoadOptions {
  util::Limits limits;
  bool missing_images_warn = false;
};

// A .gltf or .glb, told apart by content. External files are read from the scene's own folder only.
// Errors: invalid_input (the Khronos validator's codes), unsupported (an extension or version), io,
// limit (names the option).
util::Result<Document> load(const std::string& path, const LoadOptions& options);

// The same from memory, where no external file can be read; `name` stands in messages.
util::Result<Document> load_bytes(std::vector<std::uint8_t> bytes, const std::string& name,
                                  const LoadOptions& options);

// KHR_materials_variants: what the file's variants are called; empty where it has none.
std::vector<std::string> variant_names(const tinygltf::Model& model);
// The primitive's materials by variant, for those variants that it maps.
std::map<int, int> variant_materials(const tinygltf::Primitive& primitive);
// KHR_node_visibility of the node itself; its parents may still hide it.
bool node_visible(const tinygltf::Node& node);

// Extensions whose meaning octrace follows.
std::span<const std::string_view> supported_extensions();
// Material extensions that are accepted, even where required, with a warning: geometry is exact
// without them, and surfaces keep glTF's core material. Others in extensionsRequired are refused.
std::span<const std::string_view> approximated_extensions();

}  // namespace octrace::gltf
