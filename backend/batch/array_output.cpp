#include "backend/batch/array_output.h"

#include <vector>

#include "backend/image/npy.h"

namespace octrace::batch {

util::Result<void> write_arrays(const std::string& path, bool archive,
                                const render::Framebuffer& framebuffer,
                                const render::AovSet& aovs) {
  std::vector<image::Array> arrays;
  std::vector<std::uint8_t> mask;
  for (const render::AovInfo& info : render::aov_table()) {
    if (!aovs.test(static_cast<std::size_t>(info.aov))) continue;
    image::Array array;
    array.name = info.channel_count == 1 ? info.channels[0] : info.alias;
    array.shape = {framebuffer.height(), framebuffer.width()};
    if (info.channel_count > 1) {
      array.shape.push_back(static_cast<std::uint64_t>(info.channel_count));
    }
    if (info.aov == kernels::Aov::mask) {
      for (const float value : framebuffer.floats(info.aov)) mask.push_back(value != 0.0f);
      array.type = image::ArrayType::boolean;
      array.data = mask.data();
    } else if (info.uint32) {
      array.type = image::ArrayType::uint32;
      array.data = framebuffer.uints(info.aov).data();
    } else {
      array.data = framebuffer.floats(info.aov).data();
    }
    arrays.push_back(std::move(array));
  }
  if (archive) return image::write_npz(path, arrays, image::Packing::deflated);
  if (arrays.size() != 1) {
    return util::Error{util::Exit::internal, "", "a .npy holds one plane", path, ""};
  }
  return image::write_npy(path, arrays.front());
}

}  // namespace octrace::batch
