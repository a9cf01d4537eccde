#include "exporters/povray/povray.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>

#include "backend/util/atomic_file.h"
#include "exporters/povray/parts.h"

namespace octrace::exporters {

namespace {

using povray::Job;

std::vector<std::string> arguments_of(const Job& job) {
  const PovrayOptions& options = job.options;
  std::vector<std::string> arguments{"+I" + job.path.name,
                                     "+O" + job.result.image,
                                     fmt::format("+W{}", options.width),
                                     fmt::format("+H{}", options.height),
                                     "-D",
                                     "-GD",
                                     "-GR",
                                     "-GS",

                                     "+FN16",
                                     "Dither=off",
                                     "+WT2"};
  if (options.mode == PovrayMode::scene && options.antialias > 0) {
    arguments.insert(arguments.end(), {"+AM1", fmt::format("+R{}", options.antialias), "+A0.0"});
  } else {
    arguments.emplace_back("-A");
  }
  // Depth is data; a picture is for looking at.
  arguments.emplace_back(options.mode == PovrayMode::depth ? "File_Gamma=1.0" : "File_Gamma=srgb");
  return arguments;
}

std::string vector_text(const glm::dvec3& v) {
  return fmt::format("<{:.17g},{:.17g},{:.17g}>", v.x, v.y, v.z);
}

void append_camera(std::string& out, const CameraFrame& frame) {
  const double width = frame.right_edge - frame.left, height = frame.top - frame.bottom;
  const glm::dvec3 shift = frame.right * (0.5 * (frame.left + frame.right_edge)) +
                           frame.up * (0.5 * (frame.bottom + frame.top));
  fmt::format_to(std::back_inserter(out),
                 "\ncamera {{\n  {}\n  location {}\n  direction {}\n  right {}\n  up {}\n}}\n",
                 frame.orthographic ? "orthographic" : "perspective", vector_text(frame.eye),
                 vector_text(shift - frame.back), vector_text(frame.right * width),
                 vector_text(frame.up * height));
}

struct DepthRange {
  double nearest = 0.0, farthest = 0.0;
};

// Of the corners of the bounds, along the camera's axis.
DepthRange depths_of(const Job& job) {
  const scene::Bounds& bounds = job.scene.bounds;
  DepthRange range{std::numeric_limits<double>::infinity(), 0.0};
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec3 point(corner & 1 ? bounds.upper.x : bounds.lower.x,
                           corner & 2 ? bounds.upper.y : bounds.lower.y,
                           corner & 4 ? bounds.upper.z : bounds.lower.z);
    const double depth = job.frame.depth_of(job.fit(point));
    range.nearest = std::min(range.nearest, depth);
    range.farthest = std::max(range.farthest, depth);
  }
  return range;
}

Job make_job(const scene::Scene& scene, const scene::Camera& camera, const PovrayOptions& options,
             const std::string& path) {
  Job job{scene, options, povray::fit_bounds(scene.bounds), {}, 0.0, 0.0, 1.0, path_parts(path),
          {}};
  job.frame = camera_frame(camera, options.width, options.height);
  job.frame.eye = job.fit(job.frame.eye);
  if (job.frame.orthographic) {
    job.frame.left *= job.fit.scale;
    job.frame.right_edge *= job.fit.scale;
    job.frame.bottom *= job.fit.scale;
    job.frame.top *= job.fit.scale;
  }
  const DepthRange depths = depths_of(job);
  // Planes that clip nothing cost nothing.
  if (camera.znear * job.fit.scale >= depths.nearest) job.znear = camera.znear * job.fit.scale;
  job.zfar = camera.zfar * job.fit.scale;
  if (job.zfar > depths.farthest) job.zfar = std::numeric_limits<double>::infinity();
  // A little beyond the farthest point, and so the steps of 2^-30 are as small as they can be.
  job.depth_far = depths.farthest > 0.0 ? depths.farthest * (1.0 + 1e-6) : 1.0;
  job.result.depth_far = job.depth_far / job.fit.scale;
  // Not STEM.png and STEM.json, which may well be a texture and a camera of the scene's.
  job.result.image = job.path.stem + "_povray.png";
  job.result.arguments = arguments_of(job);
  return job;
}

void append_opening(std::string& out, const Job& job) {
  auto to = std::back_inserter(out);
  const std::string command = comment_text(fmt::format("{}", fmt::join(job.result.arguments, " ")));
  fmt::format_to(to,
                 "// Written by octrace for POV-Ray 3.7. In this folder:\n//   povray {}\n"
                 "// One unit here is {:.17g} of the scene's, about the scene's point {}.\n",
                 command, 1.0 / job.fit.scale, vector_text(job.fit.centre));
  if (job.options.mode == PovrayMode::depth) {
    fmt::format_to(
        to,
        "// Pixels: blue = node index + 1, 0 where nothing is hit; planar depth = (red * "
        "32768 + green)\n// * {:.17g} / 2^30 in the scene's units.\n",
        job.result.depth_far);
  }
  // Clear surfaces (back faces, holes, what lies outside of the clip planes) cost one level each.
  out += "#version 3.7;\nglobal_settings { assumed_gamma 1.0 max_trace_level 250 adc_bailout 0";
  if (job.options.mode == PovrayMode::scene) {
    const kernels::Vec3& sky = job.options.sky;
    fmt::format_to(to,
                   " ambient_light rgb <{0:.9g},{1:.9g},{2:.9g}> }}\n"
                   "background {{ rgb <{0:.9g},{1:.9g},{2:.9g}> }}\n",
                   sky.x, sky.y, sky.z);
  } else {
    out += " }\nbackground { rgb 0 }\n";
  }
}

util::Result<void> write_side_file(Job& job) {
  nlohmann::ordered_json side;
  side["version"] = 1;
  side["mode"] = job.options.mode == PovrayMode::depth ? "depth" : "scene";
  side["width"] = job.options.width;
  side["height"] = job.options.height;
  if (job.options.mode == PovrayMode::depth) side["far"] = job.result.depth_far;
  side["image"] = job.result.image;
  side["arguments"] = job.result.arguments;
  side["notes"] = job.result.notes;
  const std::string path = job.path.folder + job.path.stem + "_povray.json";
  const std::string text =
      side.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
  if (auto written = util::write_file(path, text); !written) return written;
  job.result.written.push_back(path);
  return {};
}

util::Result<void> check(const scene::Scene& scene, const PovrayOptions& options,
                         const std::string& path) {
  if (options.mode == PovrayMode::depth && scene.object_names.size() > kPovrayMaxObjects) {
    return util::Error{util::Exit::unsupported, "",
                       fmt::format("the image's 16 bits hold {} object ids, the scene has {}",
                                   kPovrayMaxObjects, scene.object_names.size()),
                       path, ""};
  }
  return {};
}

}  // namespace

util::Result<PovrayFile> write_povray(const scene::Scene& scene, const scene::Camera& camera,
                                      const PovrayOptions& options, const std::string& path) {
  if (auto ok = check(scene, options, path); !ok) return ok.error();
  Job job = make_job(scene, camera, options, path);
  job.result.written.push_back(path);

  std::string out;
  append_opening(out, job);
  append_camera(out, job.frame);
  if (auto done = povray::append_cut_functions(out, job); !done) return done.error();
  if (options.mode == PovrayMode::depth) {
    povray::append_depth_header(out, job);
  } else if (auto done = povray::append_scene_header(out, job); !done) {
    return done.error();
  }
  for (std::uint32_t i = 0; i < scene.geometries.size(); ++i) {
    if (options.mode == PovrayMode::depth) {
      povray::append_depth_mesh(out, job, i);
    } else {
      povray::append_scene_mesh(out, job, i);
    }
  }
  // The .pov comes last: where it is, the rest is.
  if (auto written = write_side_file(job); !written) return written.error();
  if (auto written = util::write_file(path, out); !written) return written.error();
  return std::move(job.result);
}

}  // namespace octrace::exporters
