// A framebuffer's planes as NumPy arrays.
#pragma once

#include <string>

#include "backend/render/framebuffer.h"
#include "backend/util/result.h"

namespace octrace::batch {

// In a .npz each plane is an array of its EXR channel's name, or of its channels' layer where it
// has several: Z, mask, object_id (H, W), RGBA (H, W, 4), N (H, W, 3). Rows from the top. float32
// and uint32; mask is boolean. A .npy holds the only plane of aovs.
util::Result<void> write_arrays(const std::string& path, bool archive,
                                const render::Framebuffer& framebuffer, const render::AovSet& aovs);

}  // namespace octrace::batch
