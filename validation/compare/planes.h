// The planes of an image that can be compared, whichever program wrote them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "backend/image/image.h"
#include "backend/util/result.h"

namespace octrace::validation {

// Rows from the top. A plane that the image does not have is empty; mask is there wherever z is.
struct Planes {
  std::uint32_t width = 0, height = 0;
  std::vector<std::uint8_t> mask;        // 1: something was hit
  std::vector<float> z;                  // planar depth, scene units; +inf: nothing was hit
  std::vector<std::uint32_t> object_id;  // glTF node index + 1; 0: nothing was hit
  std::vector<float> rgb;                // beauty, linear, three floats a pixel
  std::string depth_channel;             // the file's own name of z, for messages
};

// Recognises the channels of octrace (Z, mask, A, object_id), Blender's multilayer OpenEXR
// (ViewLayer.Depth.Z with 1e10 behind everything, ViewLayer.Combined.RGBA, ViewLayer.IndexOB.X) and
// plain OpenEXR (Z or depth, A or mask, R G B). The mask comes from `mask`, else alpha, else where
// Z is finite. Errors (exit 3): an empty image, no channel that is known (those that are there are
// named), NaN in a plane that is compared.
util::Result<Planes> planes_from_image(const image::Image& image, const std::string& file);

// exporters/povray's depth encoding, a 16-bit RGB PNG. With R, G, B the 16-bit integers:
//   B      object id (glTF node index + 1); 0 where nothing was hit
//   depth  (R * 32768 + G) * far_distance / 2^30, R and G below 32768
// far_distance: in the scene's units, so that whatever scaling the export did cancels out. Errors
// (exit 3): another kind of image, a value that the encoding cannot have made.
util::Result<Planes> planes_from_povray(const image::Image& image, double far_distance,
                                        const std::string& file);

}  // namespace octrace::validation
