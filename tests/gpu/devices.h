// The devices that this machine has, so that one test body runs on all of them.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "backend/render/device.h"

namespace octrace::tests {

inline std::vector<render::DeviceChoice> devices() {
  std::vector<render::DeviceChoice> all = {{render::DeviceKind::cpu, 0}};
  if (render::cuda_unavailable(0).empty()) all.push_back({render::DeviceKind::cuda, 0});
  return all;
}

inline std::string device_name(const render::DeviceChoice& device) {
  return device.kind == render::DeviceKind::cpu ? "cpu" : "cuda";
}

// The scenes move with the tests to machines that the build machine's folders do not reach.
inline std::filesystem::path scenes_folder() {
  const char* folder = std::getenv("OCTRACE_SCENES");
  return folder != nullptr ? folder : OCTRACE_SHARED_SCENES;
}

}  // namespace octrace::tests
