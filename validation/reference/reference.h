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

// One .pov in depth mode; fields as exporters::PovrayFile has them.
struct PovrayJob {
  std::string folder;                  // where the .pov lies, and the working directory
  std::vector<std::string> arguments;  // after the program's name
  std::string image;                   // the PNG that they make, in the folder
  std::uint32_t width = 0, height = 0;
  double far_distance = 0.0;  // planar depth, scene units, that the encoding's 2^30 stands for
};
util::Result<Planes> run_povray(const PovrayJob& job, const ProgramOptions& options);

// One Python script that renders any number of views in one process, because Blender takes two
// seconds to start. The script goes on when a view fails and says so in a line "octrace: failed
// ...", and then ends with an exception.
struct BlenderView {
  std::string output;  // path of the OpenEXR; removed before the run
  std::uint32_t width = 0, height = 0;
};
struct BlenderJob {
  std::string folder;                  // working directory
  std::vector<std::string> arguments;  // as exporters::blender_arguments has them
  std::vector<BlenderView> views;
};
// One result a view: one that failed does not take the others with it. The outer error is that of a
// program that is missing (exit 4) or did not start (exit 5).
util::Result<std::vector<util::Result<Planes>>> run_blender(const BlenderJob& job,
                                                            const ProgramOptions& options);

}  // namespace octrace::validation
