// glTF file and cameras -> a Python script that renders them inside Blender (3.4 or later), one
// process for any number of scenes and cameras.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "backend/scene/scene.h"
#include "backend/util/result.h"

namespace octrace::exporters {

// One image. Blender clips at planes: clip_start and clip_end are planar depths in metres; use
// blender_clip() unless you know better.
struct BlenderView {
  scene::Camera camera;
  int width = 640, height = 480;
  double clip_start = 0.01, clip_end = 1000.0;
  std::string output;  // *.exr, absolute or relative to the script's folder
};

struct BlenderScene {
  std::string file;               // the original .gltf or .glb, absolute or as for output
  std::optional<int> gltf_scene;  // as --scene N; default: the file's own, else 0, else all nodes
  // Blender's own evaluation of an animation (a name, else an index; empty: the first) at a time;
  // none: at rest. It has glTF's values at keys, but its own between them: no arcs, no tangents.
  std::optional<double> seconds;
  std::string animation;
  bool cull = true, alpha = true;  // as in PovrayOptions
  std::vector<BlenderView> views;
};

// The encoding of an output: OpenEXR multilayer, 32-bit float, row 0 at the top, one ray through
// each pixel's centre:
//   ViewLayer.Combined.A   mask: exactly 0 or 1 (R, G, B: white where hit)
//   ViewLayer.Depth.Z      planar depth in metres; 1e10 where nothing is hit
//   ViewLayer.IndexOB.X    glTF node index + 1, the low 15 bits that Blender holds; 0: background
//   ViewLayer.Normal.*     shading normal
//   ViewLayer.Position.*   point; both in Blender's axes, which are (x, -z, y) of glTF's
// The script prints "octrace: rendered PATH" after each image, "octrace: failed FILE: reason" for a
// scene or view that failed (the others go on), and raises at its end if any did, so that Blender
// exits with the code of --python-exit-code. An output is whole or absent; an old one is removed
// before anything else happens. A camera that mirrors fails: Blender has none.
// Known difference: where a texture's two wrap modes differ, Blender's importer does not filter
// across the seam, so alpha mode MASK may cut half a texel elsewhere there.
inline constexpr double kBlenderBackgroundDepth = 1e10;
inline constexpr std::uint32_t kBlenderMaxObject = 32767;

// Clip planes that clip nothing of these bounds beyond the camera's own znear and zfar.
void blender_clip(const scene::Bounds& bounds, BlenderView& view);

// Arguments after "blender" that run the script.
std::vector<std::string> blender_arguments(const std::string& script);

util::Result<void> write_blender(const std::vector<BlenderScene>& scenes, const std::string& path);

}  // namespace octrace::exporters
