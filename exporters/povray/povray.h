// Scene and camera -> POV-Ray 3.7 scene description, for proof (depth) or for looking at (scene).
#pragma once

#include <string>
#include <vector>

#include "backend/scene/scene.h"
#include "backend/util/result.h"
#include "kernels/render_params.h"

namespace octrace::exporters {

enum class PovrayMode {
  depth,  // planar depth, mask and object id, encoded exactly in a 16-bit PNG
  scene,  // an approximation of the materials and lights, as a picture
};

struct PovrayOptions {
  PovrayMode mode = PovrayMode::depth;
  int width = 640, height = 480;
  bool cull = true;  // back faces of single-sided materials are not there
  bool alpha =
      true;  // alpha mode MASK cuts out; BLEND is solid in depth mode, as in octrace's AOVs
  // Scene mode: radiance of the sky, linear, as octrace renders by default.
  kernels::Vec3 sky = kernels::RenderParams{}.sky;
  int antialias = 0;  // scene mode: +A with this many subdivisions; 0: one ray a pixel
};

// The encoding of depth mode. The image is a 16-bit RGB PNG without gamma, row 0 at the top, one
// ray through each pixel's centre. With R, G, B as the stored 16-bit integers:
//   B        object index + 1 (glTF node index + 1), 1 to 65535; 0: nothing was hit (mask 0, and
//            then R = G = 0 and depth is +infinity)
//   q        = R * 32768 + G, R and G each below 32768: planar depth in steps of far / 2^30
//   depth    = q * (far / 2^30), in the scene's own units (metres), error at most half a step
// far is not in the PNG: it is PovrayFile::depth_far and "far" in the side file.
inline constexpr int kPovrayDepthBits = 30;
inline constexpr double kPovrayDepthSteps = 1073741824.0;  // 2^30
inline constexpr int kPovrayHalf = 32768;                  // 2^15
inline constexpr std::uint32_t kPovrayMaxObjects = 65535;

struct PovrayFile {
  double depth_far = 0.0;  // depth mode: see above
  std::vector<std::string>
      arguments;                     // after "povray": renders IMAGE.png from the .pov's own folder
  std::string image;                 // the PNG that those arguments make, beside the .pov
  std::vector<std::string> written;  // every file, the .pov first
  // What POV-Ray cannot show as octrace does, one line each; empty: nothing known. Lines about the
  // look only (scene mode) and lines about coverage (depth mode) never mix: the mode decides.
  std::vector<std::string> notes;
};

// Writes PATH (*.pov), in depth mode the alpha maps that it needs, in scene mode the textures, as
// PNG files named after it, and STEM_povray.json beside the image
// STEM_povray.png that it describes: {"version": 1, "mode": "depth" | "scene",
// "width", "height", "far": number, "image", "arguments": [...], "notes": [...]}. Each file is
// whole or absent, the .pov written last. Fails with exit 4 where a scene has more than 65535
// objects (depth mode).
util::Result<PovrayFile> write_povray(const scene::Scene& scene, const scene::Camera& camera,
                                      const PovrayOptions& options, const std::string& path);

}  // namespace octrace::exporters
