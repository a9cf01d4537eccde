// A glTF animation at a time: the pose that it gives to a document's nodes.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "backend/gltf/document.h"
#include "backend/scene/pose.h"
#include "backend/scene/sampler.h"
#include "backend/util/result.h"

namespace octrace::scene {

// --animation: a name, else an index; empty: the first. Nothing where `choice` is "none" or where
// the file has no animation and none is asked for by name or index. Usage errors list what there
// is.
util::Result<std::optional<int>> choose_animation(const gltf::Document& document,
                                                  const std::string& choice);

class Animation {
 public:
  // Reads the samplers that channels use. Errors (exit 3) where counts do not fit, which load() has
  // checked before.
  static util::Result<Animation> read(const gltf::Document& document, int index);

  // Moves what the channels name and leaves the rest of the pose alone. Any time; a channel holds
  // its first and last key's value before and after them.
  void apply(double seconds, Pose& pose) const;

  // The key times at which no channel is between two of its keys, ascending.
  std::vector<double> shared_keys() const;

 private:
  enum class Path : std::uint8_t { translation, rotation, scale, weights };
  struct Channel {
    int node;
    Path path;
    std::size_t sampler;  // index into samplers_
  };
  std::vector<Channel> channels_;
  std::vector<Sampler> samplers_;
};

}  // namespace octrace::scene
