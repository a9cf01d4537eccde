// Which device renders: --device auto | cpu | cuda | cuda:N.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "backend/render/renderer.h"
#include "backend/util/result.h"

namespace octrace::render {

enum class DeviceKind { automatic, cpu, cuda };

struct DeviceChoice {
  DeviceKind kind = DeviceKind::automatic;
  int index = 0;  // of the GPU
};

util::Result<DeviceChoice> parse_device(std::string_view text);  // exit 2

// Whether a GPU can be used, and if not, why: built without CUDA, no driver, no GPU, too old.
// Empty: it can.
std::string cuda_unavailable(int index);

// A renderer on the device chosen. Where the GPU cannot be used, or does not have the memory, the
// renderer is the CPU's: a warning says why, for `automatic` a message only when verbose. The scene
// and the octree must outlive it.
std::unique_ptr<Renderer> make_renderer(const scene::Scene& scene, const octree::Octree& octree,
                                        const DeviceChoice& choice);

}  // namespace octrace::render
