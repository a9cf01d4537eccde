// The image files that a render writes, and what goes into each.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "backend/image/image.h"
#include "backend/render/framebuffer.h"
#include "backend/scene/camera.h"
#include "backend/util/result.h"

namespace octrace::batch {

struct ImageSize {
  std::uint32_t width = 1280, height = 720;
};

util::Error usage_error(const std::string& message);

enum class FileKind { exr, png, tiff, jpeg, npy, npz };

struct Output {
  std::string path;
  FileKind kind = FileKind::exr;
  render::AovSet aovs;  // one, but for an EXR or NPZ
};

// One file: the planes named for it, else those listed for all where its format holds them. The
// error's message says what is wrong with the path, without the path.
util::Result<Output> plan_file(const std::string& path, const std::optional<render::AovSet>& named,
                               const render::AovSet& listed, const ImageSize& size);

// The arguments of -o: PATH, or PATH:AOV[,AOV...]. The text after the last colon names AOVs when it
// holds neither '.' nor '/'. An EXR or NPZ without names holds those of --aov (default beauty); a
// PNG, TIFF, JPEG or NPY holds the one that --aov names, where that is one, else beauty. Usage
// errors: an unknown extension or AOV, a plane that the format cannot hold, a path given twice, an
// AOV asked for by --aov that no file holds.
util::Result<std::vector<Output>> plan_outputs(const std::vector<std::string>& arguments,
                                               const std::optional<std::string>& aov_list,
                                               const ImageSize& size);

render::AovSet needed_aovs(const std::vector<Output>& outputs);
// Whether any of the files is written through the image library (image::preload).
bool needs_image_library(const std::vector<Output>& outputs);

// Exit 5 where a file could not be created; nothing stays behind.
util::Result<void> check_writable(const std::string& path);

// Whether any of the planes shows a texture; where not, only those that alpha tests need are read.
bool needs_textures(const render::AovSet& aovs);

using Metadata = std::vector<std::pair<std::string, std::string>>;
// octrace:version, octrace:scene, octrace:camera.
Metadata view_metadata(const std::string& scene_source, const scene::Camera& camera);
// What to warn of before a depth plane becomes 16-bit integers: hits beyond their range, which read
// as the background does. None: all fit, or the output is of another kind.
std::optional<std::string> depth_warning(const Output& output,
                                         const render::Framebuffer& framebuffer,
                                         double depth_scale);
util::Result<void> write_output(const Output& output, const render::Framebuffer& framebuffer,
                                double depth_scale, const Metadata& metadata);

}  // namespace octrace::batch
