// A scene made ready to trace, once, for as many views as wanted: read, flattened, octree built.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "backend/octree/octree.h"
#include "backend/octree/update.h"
#include "backend/scene/animator.h"
#include "backend/scene/scene.h"
#include "backend/scene/scene_info.h"
#include "backend/util/limits.h"
#include "backend/util/result.h"

namespace octrace::batch {

struct SceneRequest {
  std::string source;         // a file, or builtin:NAME
  std::optional<int> scene;   // --scene
  std::string variant;        // --variant: name or index, empty for none
  bool decode_images = true;  // false: textures are white, for uses that look at no image
  bool need_textures = true;  // false: only textures that alpha tests need are decoded
  bool missing_images_warn = false;
  std::string animation;       // --animation; where a time is given or the session is to move
  scene::Time time;            // nothing: at rest
  bool moving = false;         // keep what SceneSession::move_to() and at() need
  bool refits = false;         // the octree is to follow many calls of move_to()
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
  octree::BuildOptions build;                 // as the octree was built
  octree::Upkeep upkeep;                      // what the last move did to it
  std::unique_ptr<scene::Animator> animator;  // null: nothing moves
  double load_ms = 0.0, build_ms = 0.0, verify_ms = 0.0;

  // Scene and octree at another time; says which arrays of the scene changed (any(): the octree's
  // as well where geometry()). Renderers of the session must be told: Renderer::refresh(). After an
  // error the next call puts the session right. Nothing happens where nothing moves.
  util::Result<scene::SceneChanges> move_to(scene::Time time);

  // Vertices and cameras at another time, for motion; the session stays where it is.
  util::Result<scene::Moment> at(scene::Time time) const;
};

// Warnings of the scene are logged. The session stays where it is, so that renderers may refer to
// it.
util::Result<std::unique_ptr<SceneSession>> open_scene(const SceneRequest& request);

}  // namespace octrace::batch
