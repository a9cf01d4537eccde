// The one translation unit that holds tinygltf's code. Compiled here rather than linked from
// Debian's shared library, so that sanitizers see it and its file and image code is not in the
// program at all.
#include <fstream>  // which it needs and, without its file code, does not include

#define TINYGLTF_IMPLEMENTATION
#include "backend/gltf/tinygltf.h"
