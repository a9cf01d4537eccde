// A scene made ready to trace, once, for as many views as wanted: read, flattened, octree built.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "backend/octree/octree.h"
#include "backend/scene/scene.h"
#include "backend/scene/scene_info.h"
#include "backend/util/limits.h"
#include "backend/util/result.h"

namespace octrace::batch {

struct SceneRequest {
  std::string source;         // a file, or builtin:NAME
  std::optional<int> scene;   // --scene
  bool decode_images = true;  // false: textures are white, for uses that look at no image
  bool need_textures = true;  // false: only textures that alpha tests need are decoded
  bool missing_images_warn = false;
  bool collect_info = false;   // fill SceneSession::info
  bool verify = false;         // check the octree
  octree::BuildOptions build;  // max_bytes comes from limits
  util::Limits limits;
};

struct SceneSession {
  std::string source;
  scene::Scene scene;
  octree::Octree octree;
  std::optional<scene::SceneInfo> info;
  double load_ms = 0.0, build_ms = 0.0, verify_ms = 0.0;
};

// Warnings of the scene are logged. The session stays where it is, so that renderers may refer to
// it.
util::Result<std::unique_ptr<SceneSession>> open_scene(const SceneRequest& request);

}  // namespace octrace::batch
