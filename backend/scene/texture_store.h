// Which textures a scene's materials use, and their texels: each image is decoded once, however
// many textures, samplers, encodings and copies in the file share it.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "backend/gltf/document.h"
#include "backend/scene/flatten.h"
#include "backend/scene/scene.h"
#include "backend/util/result.h"

namespace octrace::scene {

class TextureStore {
 public:
  TextureStore(const gltf::Document& document, const FlattenOptions& options)
      : document_(document), options_(options) {}

  // A number for the pair of glTF texture and encoding, to be resolved by indices() after load();
  // kNone where the texture names no image that can be read.
  std::uint32_t request(int texture, bool srgb);

  // Decodes, in parallel, and fills textures and texels. Afterwards index_of(number) is the index
  // into scene.textures, kNone where its image is missing and options say to go on.
  util::Result<void> load(Scene& scene);
  std::uint32_t index_of(std::uint32_t number) const {
    return number == kernels::kNone ? kernels::kNone : indices_[number];
  }
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  struct Request {
    int image, sampler;
    bool srgb;
  };
  struct Block {  // the texels of one distinct image
    bool loaded = false;
    std::uint64_t first = 0;
    std::uint32_t width = 0, height = 0;
  };

  util::Result<void> decode(std::vector<DecodedImage>& decoded, const std::vector<int>& distinct,
                            std::uint64_t bytes_taken);
  void warn(std::string message);

  const gltf::Document& document_;
  const FlattenOptions& options_;
  std::vector<Request> requests_;
  std::map<std::tuple<int, int, bool>, std::uint32_t> known_;
  std::vector<std::uint32_t> indices_;
  std::vector<std::string> warnings_;
};

}  // namespace octrace::scene
