// glTF document -> Scene: node transforms, skins and morph targets applied in the static pose.
#pragma once

#include <functional>
#include <optional>
#include <span>

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

// `roots` and all their descendants, ascending.
std::vector<int> reachable_nodes(const tinygltf::Model& model, const std::vector<int>& roots);

}  // namespace octrace::scene
