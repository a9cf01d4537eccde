// Embree over the same triangles, for the same rays.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "backend/scene/scene.h"
#include "kernels/ray.h"

namespace octrace::bench {

class EmbreePeer {
 public:
  enum class Quality { medium, high };
  enum class Interface { single, packet, stream };

  static bool available();       // was this program built with Embree?
  static std::string version();  // empty where it was not

  EmbreePeer(const scene::Scene& scene, Quality quality, unsigned threads);
  ~EmbreePeer();
  double build_seconds() const { return build_seconds_; }

  // Seconds; hits (t and triangle) are written where the pointer is not null. Any-hit queries leave
  // t = -inf where something was hit. coherent: what packets and streams are told about the rays.
  double trace(const std::vector<kernels::Ray>& rays, bool any_hit, bool coherent,
               Interface interface, unsigned threads, std::vector<kernels::Hit>* hits) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
  double build_seconds_ = 0.0;
};

}  // namespace octrace::bench
