// Runs POV-Ray and Blender on what exporters/ wrote and decodes their images.
//
// The agreement with exporters/: an exporter writes files into a folder that the caller made and
// says which they are; nothing is run by an exporter, and nothing is written by a reference but
// images and logs in that same folder. The caller (backend/app) copies the few fields across, so
// that neither folder includes the other.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "backend/util/limits.h"
#include "backend/util/result.h"
#include "validation/compare/planes.h"

namespace octrace::validation {

struct ProgramOptions {
  std::string program;  // a name searched on PATH, or a path
  std::chrono::seconds timeout{120};
  int threads = 0;  // 0: as many as the machine has
  util::Limits limits;
  const std::atomic<bool>* cancel = nullptr;
};

// One .pov of `--mode depth`, encoded as planes_from_povray describes.
struct PovrayJob {
  std::string scene;  // path of the .pov
  std::uint32_t width = 0, height = 0;
  double far_distance = 0.0;  // planar depth, scene units, that q = 2^30 would stand for
};
util::Result<Planes> run_povray(const PovrayJob& job, const ProgramOptions& options);

// One Python script that renders any number of views in one process, because Blender takes two
// seconds to start. The script must write outputs[i] for view i (OpenEXR multilayer, channels as in
// planes_from_image; object id as pass index where it knows the glTF node), must go on with the
// next view when one fails, printing a line "octrace: view I: reason", and must then end by an
// exception, which --python-exit-code turns into a non-zero exit.
struct BlenderJob {
  std::string script;                // path of the .py
  std::vector<std::string> outputs;  // paths, one a view; deleted before the run
  std::vector<std::pair<std::uint32_t, std::uint32_t>> sizes;  // expected width and height
};
// One result a view: a view that failed does not take the others with it. The outer error is that
// of a program that is missing (exit 4) or did not start.
util::Result<std::vector<util::Result<Planes>>> run_blender(const BlenderJob& job,
                                                            const ProgramOptions& options);

}  // namespace octrace::validation
