// glTF document -> Scene: node transforms, skins and morph targets applied in the static pose.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>

#include "backend/gltf/document.h"
#include "backend/scene/scene.h"
#include "backend/util/limits.h"
#include "backend/util/result.h"

namespace octrace::scene {

// RGBA8, rows from the top.
struct DecodedImage {
  std::uint32_t width = 0, height = 0;
  std::vector<std::uint32_t> texels;
};

// Decodes a PNG, JPEG or WebP in memory. Injected, so that the scene does not depend on an image
// library; may be called from several threads at once.
using ImageDecoder = std::function<util::Result<DecodedImage>(
    std::span<const std::uint8_t> bytes, const std::string& mime, const util::Limits& limits)>;

struct FlattenOptions {
  std::optional<int> scene;          // --scene N; default: the file's own, else 0, else all nodes
  std::string variant;               // --variant NAME|INDEX of KHR_materials_variants; empty: none
  bool need_textures = true;         // false: only what geometry and alpha tests need is decoded
  bool missing_images_warn = false;  // --missing-images warn: render with the factor alone
  util::Limits limits;
  ImageDecoder decode;
};

// In the static pose: the nodes' own transforms, default weights of morph targets. Missing normals
// stay missing (flat shading, as the specification says), and so do missing tangents, which the
// renderer derives from positions and texture coordinates.
util::Result<Scene> flatten(const gltf::Document& document, const FlattenOptions& options);

struct Pose;
util::Result<Scene> flatten(const gltf::Document& document, const Pose& pose,
                            const FlattenOptions& options);

// The index of FlattenOptions::variant, by name before by number; -1 where it is empty. Usage error
// where there is no such variant.
util::Result<int> find_variant(const gltf::Document& document, const std::string& variant);

// Those of `nodes` that neither hide themselves nor lie below one that does (KHR_node_visibility).
std::vector<int> visible_nodes(const tinygltf::Model& model, const std::vector<int>& nodes);

// `roots` and all their descendants, ascending.
std::vector<int> reachable_nodes(const tinygltf::Model& model, const std::vector<int>& roots);

}  // namespace octrace::scene
