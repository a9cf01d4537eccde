// Which octrace this is.
#pragma once

namespace octrace::util {

const char* version();  // "0.1.0"

}  // namespace octrace::util
