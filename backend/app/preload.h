// Starts what a render needs later and what takes long to load.
#pragma once

namespace octrace::app {

// image: files are written through the image library.
void preload_libraries(bool image);

}  // namespace octrace::app
