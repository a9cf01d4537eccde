// A batch job as its file says it (docs/batch.md), checked as far as that goes without the scenes.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "backend/batch/json_at.h"
#include "backend/batch/output.h"
#include "backend/batch/output_pattern.h"
#include "backend/scene/camera.h"
#include "kernels/render_params.h"

namespace octrace::batch {

struct JobScene {
  std::string source;        // builtin:NAME, or the file's path, from the job's folder
  std::string path;          // as the job has it
  std::string name;          // what {scene} stands for, before path_name()
  std::optional<int> scene;  // index of the glTF scene
  std::string variant;       // name or index; empty: the file's own materials
};

struct AllCameras {};
struct NamedCamera {
  std::variant<std::string, std::int64_t> which;
};
// From the job or a file it names: they do not depend on a scene.
struct GivenCameras {
  std::vector<scene::Camera> cameras;
};
// n views towards a target, from around it: evenly along a circle, or random over the upper half
// of a sphere.
struct OrbitCameras {
  std::string name;
  bool random = false;
  std::uint64_t n = 0, seed = 0;
  double start = 0.0, elevation = 0.0, fov = 40.0;  // degrees
  std::optional<double> distance;                   // none: the bounding sphere fits
  std::optional<glm::dvec3> target;                 // none: the middle of the bounds
};
using CameraEntry = std::variant<AllCameras, NamedCamera, GivenCameras, OrbitCameras>;

struct JobOutput {
  OutputPattern pattern;
  std::vector<std::string> aov_words;  // as the job names them, one plane each
  std::vector<Output> files;           // one, or one a plane where the pattern has {aov}; no paths
};

// Views go into tar files, so many into each, instead of files of their own.
struct JobPack {
  OutputPattern path;
  std::uint64_t views = 0;
};

struct Job {
  std::string file, folder;  // folder: "" or ends in '/'
  std::vector<JobScene> scenes;
  std::vector<CameraEntry> cameras;
  std::vector<std::int64_t> frames;  // empty: at rest, as frame 0
  double fps = 24.0;
  std::optional<std::variant<std::string, std::int64_t>> animation;  // "none": no movement
  std::string variant;                                               // of scenes that name none
  ImageSize size;
  render::AovSet aovs;
  std::vector<JobOutput> outputs;
  std::optional<JobPack> pack;  // outputs are names in it
  std::string device = "auto", compression = "zip";
  kernels::RenderParams params;
  double depth_scale = 1000.0;
  bool missing_images_warn = false, objects = false;
  bool coco_masks = false, coco_counts = false;  // counts: as lists, not as strings
};

// Usage errors with the place in the file; exit 5 or 6 for the file itself; exit 3 for a camera or
// transforms file that the job names.
util::Result<Job> read_job(const std::string& path, const util::Limits& limits);
util::Result<Job> parse_job(const Json& json, const std::string& path, const util::Limits& limits);

// Parts of read_job.
util::Result<std::vector<CameraEntry>> parse_cameras(const JsonAt& list, const Job& job,
                                                     const util::Limits& limits);
util::Result<std::vector<JobOutput>> parse_outputs(const JsonAt& json,
                                                   const std::vector<std::string>& aovs,
                                                   const Job& job);

util::Result<JobPack> parse_pack(const JsonAt& json);

std::string path_beside(const std::string& folder, const std::string& path);

}  // namespace octrace::batch
