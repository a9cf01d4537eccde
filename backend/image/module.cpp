#include "backend/image/module.h"

#include <OpenImageIO/imageio.h>

#include "backend/image/module_parts.h"
#include "backend/util/version.h"

namespace octrace::image {

namespace {

void set_library_threads(unsigned threads) {
  OIIO::attribute("threads", static_cast<int>(threads));
  // One thread is the caller's own: a pool of one would compress all writers' files in turn.
  OIIO::attribute("exr_threads", threads == 1 ? -1 : static_cast<int>(threads));
}

const ModuleTable kTable = {util::version(),    set_library_threads, write_exr_file,
                            write_integer_file, read_file,           decode_memory};

}  // namespace

}  // namespace octrace::image

extern "C" __attribute__((visibility("default"))) const octrace::image::ModuleTable*
octrace_image_module() {
  return &octrace::image::kTable;
}
