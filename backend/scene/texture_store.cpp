#include "backend/scene/texture_store.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <optional>
#include <string_view>
#include <unordered_map>

namespace octrace::scene {

namespace {

kernels::Wrap wrap_of(int mode) {
  if (mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return kernels::Wrap::clamp;
  if (mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT) return kernels::Wrap::mirror;
  return kernels::Wrap::repeat;
}

kernels::Texture sampled_by(const tinygltf::Model& model, int sampler) {
  kernels::Texture texture{};
  texture.filter = kernels::Filter::linear;
  if (sampler < 0) return texture;
  texture.wrap_s = wrap_of(model.samplers[sampler].wrapS);
  texture.wrap_t = wrap_of(model.samplers[sampler].wrapT);
  // Only the magnifying filter says something about single samples of the full-size image.
  if (model.samplers[sampler].magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST) {
    texture.filter = kernels::Filter::nearest;
  }
  return texture;
}

// EXT_texture_webp names an image beside or in place of the texture's own.
int image_of(const tinygltf::Model& model, int texture) {
  const tinygltf::Texture& source = model.textures[texture];
  const auto webp = source.extensions.find("EXT_texture_webp");
  if (webp != source.extensions.end() && webp->second.IsObject() && webp->second.Has("source") &&
      webp->second.Get("source").IsNumber()) {
    const int image = webp->second.Get("source").GetNumberAsInt();
    if (image >= 0 && static_cast<std::size_t>(image) < model.images.size()) return image;
  }
  return source.source;
}

}  // namespace

void TextureStore::warn(std::string message) {
  if (std::find(warnings_.begin(), warnings_.end(), message) == warnings_.end()) {
    warnings_.push_back(std::move(message));
  }
}

std::uint32_t TextureStore::request(int texture, bool srgb) {
  const int image = image_of(document_.model, texture);
  if (image < 0) {
    warn(fmt::format("texture {} names no image that octrace reads; the factor alone is used",
                     texture));
    return kernels::kNone;
  }
  const int sampler = document_.model.textures[texture].sampler;
  const auto [entry, added] =
      known_.try_emplace({image, sampler, srgb}, static_cast<std::uint32_t>(requests_.size()));
  if (added) requests_.push_back({image, sampler, srgb});
  return entry->second;
}

util::Result<void> TextureStore::load(Scene& scene) {
  // Images of equal bytes, whatever they are called in the file, become one block of texels.
  std::unordered_map<std::string_view, std::size_t> by_content;
  std::vector<int> distinct;
  std::map<int, std::size_t> block_of;
  for (const Request& request : requests_) {
    const auto& bytes = document_.images[request.image].bytes;
    const std::string_view content(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    const auto [entry, added] = by_content.try_emplace(content, distinct.size());
    if (added) distinct.push_back(request.image);
    block_of[request.image] = entry->second;
  }
  std::vector<DecodedImage> decoded(distinct.size());
  if (auto ok = decode(decoded, distinct, scene.bytes()); !ok) return ok;

  std::vector<Block> blocks(distinct.size());
  std::uint64_t total = 0;
  for (std::size_t i = 0; i < decoded.size(); ++i) {
    if (decoded[i].texels.empty()) continue;
    blocks[i] = {true, total, decoded[i].width, decoded[i].height};
    total += decoded[i].texels.size();
  }
  scene.texels.reserve(total);
  for (DecodedImage& image : decoded) {
    scene.texels.insert(scene.texels.end(), image.texels.begin(), image.texels.end());
    image = {};
  }
  for (const Request& request : requests_) {
    const Block& block = blocks[block_of[request.image]];
    if (!block.loaded) {
      indices_.push_back(kernels::kNone);
      continue;
    }
    kernels::Texture texture = sampled_by(document_.model, request.sampler);
    texture.first_texel = block.first;
    texture.width = block.width;
    texture.height = block.height;
    texture.srgb = request.srgb ? 1 : 0;
    indices_.push_back(static_cast<std::uint32_t>(scene.textures.size()));
    scene.textures.push_back(texture);
  }
  return {};
}

util::Result<void> TextureStore::decode(std::vector<DecodedImage>& decoded,
                                        const std::vector<int>& distinct,
                                        std::uint64_t bytes_taken) {
  std::vector<std::optional<util::Error>> errors(distinct.size());
  std::atomic<std::uint64_t> bytes{bytes_taken};
  tbb::parallel_for(std::size_t{0}, distinct.size(), [&](std::size_t i) {
    const gltf::EncodedImage& image = document_.images[distinct[i]];
    const auto failed = [&](util::Exit exit, std::string message) {
      errors[i] = util::Error{exit, "", std::move(message), document_.file, image.pointer};
    };
    if (bytes > options_.limits.max_scene_bytes) return;  // reported by whoever passed the limit
    if (image.bytes.empty()) return failed(util::Exit::io, "the image is missing");
    if (!options_.decode) return failed(util::Exit::internal, "no image decoder was given");
    auto result = options_.decode(image.bytes, image.mime, options_.limits);
    if (!result) {
      errors[i] = result.error();
      if (errors[i]->file.empty()) errors[i]->file = document_.file;
      if (errors[i]->pointer.empty()) errors[i]->pointer = image.pointer;
      return;
    }
    const std::uint64_t size = std::uint64_t{result->width} * result->height;
    if (size == 0 || result->texels.size() != size) {
      return failed(util::Exit::internal,
                    fmt::format("decoded to {} texels, {}x{} were expected", result->texels.size(),
                                result->width, result->height));
    }
    // Twice: as decoded and in the scene's one array.
    if ((bytes += 2 * size * sizeof(std::uint32_t)) > options_.limits.max_scene_bytes) {
      return failed(util::Exit::limit,
                    fmt::format("with this image the scene needs {} bytes or more, "
                                "--max-scene-bytes allows {}",
                                bytes.load(), options_.limits.max_scene_bytes));
    }
    decoded[i] = std::move(*result);
  });
  for (const auto& error : errors) {
    if (!error) continue;
    const bool broken = error->exit != util::Exit::limit && error->exit != util::Exit::internal;
    if (!broken || !options_.missing_images_warn) return *error;
    warn(error->to_string() + "; the factor alone is used");
  }
  return {};
}

}  // namespace octrace::scene
