// libhwy measures its benchmarks' timer whenever it is loaded: a third of the time that
// `octrace --help` takes. Nothing here uses that timer, so the program's own function takes the
// place of the library's.
#include <hwy/nanobenchmark.h>

#include <cstdint>

namespace hwy::platform {

std::uint64_t TimerResolution() { return 1; }

}  // namespace hwy::platform
