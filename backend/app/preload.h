// Starts what a render needs later and what takes long to load.
#pragma once

namespace octrace::app {

void preload_libraries();

}  // namespace octrace::app
