// What a batch wants to know of a scene before loading it: which cameras it has, and whether it is
// still the same file.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "backend/batch/job.h"
#include "backend/util/limits.h"

namespace octrace::batch {

// Names of the scene's cameras as scene::flatten() orders them, from the JSON alone: no buffer and
// no image is read. Empty optional: the file cannot be read; loading it will say why.
std::optional<std::vector<std::string>> probe_cameras(const JobScene& scene,
                                                      const util::Limits& limits);

// Sizes and times of the scene's file and of those it names, as text; "" for a built-in scene or a
// missing file.
std::string file_identity(const JobScene& scene, const util::Limits& limits);

}  // namespace octrace::batch
