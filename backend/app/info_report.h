// What `octrace info` prints.
#pragma once

#include <string>

#include "backend/octree/octree.h"
#include "backend/scene/scene_info.h"

namespace octrace::app {

std::string info_text(const scene::SceneInfo& info, const octree::Statistics& octree);
std::string info_json(const scene::SceneInfo& info, const octree::Statistics& octree);

}  // namespace octrace::app
