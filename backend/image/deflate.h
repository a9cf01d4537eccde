// DEFLATE (RFC 1951) for files. ISA-L, where the build has it, is several times as fast as zlib's
// fastest level and makes files of about the same size. Its bytes may differ from zlib's, and
// between processors with and without AVX2; what they decompress to does not.
#pragma once

#include <functional>
#include <span>
#include <string_view>

#include "backend/util/result.h"

namespace octrace::image {

// Takes a piece of the stream; an error ends it.
using DeflateSink = std::function<util::Result<void>(std::string_view piece)>;

// The parts one after another as one raw stream. Exit 6, or bad_alloc: no memory for it.
util::Result<void> deflate(std::span<const std::string_view> parts, const DeflateSink& sink);

}  // namespace octrace::image
