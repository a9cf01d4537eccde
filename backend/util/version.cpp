#include "backend/util/version.h"

namespace octrace::util {

const char* version() { return OCTRACE_VERSION; }

}  // namespace octrace::util
