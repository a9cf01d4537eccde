// A build without Embree: no command offers the peer, so nothing below available() is reached.
#include <stdexcept>

#include "tests/bench/embree_peer.h"

namespace octrace::bench {

struct EmbreePeer::Impl {};

bool EmbreePeer::available() { return false; }

std::string EmbreePeer::version() { return ""; }

EmbreePeer::EmbreePeer(const scene::Scene&, Quality, unsigned) {
  throw std::logic_error("built without Embree");
}

EmbreePeer::~EmbreePeer() = default;

double EmbreePeer::trace(const std::vector<kernels::Ray>&, bool, bool, Interface, unsigned,
                         std::vector<kernels::Hit>*) const {
  throw std::logic_error("built without Embree");
}

}  // namespace octrace::bench
