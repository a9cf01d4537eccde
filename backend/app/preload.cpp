#include "backend/app/preload.h"

#include <oneapi/tbb/parallel_for.h>

#include "backend/image/image.h"

namespace octrace::app {

void preload_libraries(bool image) {
  // oneTBB opens libraries of its own when it first runs something, and would wait for the dynamic
  // loader's lock until the image library is in: 140 ms instead of 1.
  oneapi::tbb::parallel_for(0, 2, [](int) {});
  if (image) image::preload();
}

}  // namespace octrace::app
