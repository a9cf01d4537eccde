// Boxes of references in the registers of eight-inl.h.
#if defined(OCTRACE_BOX8_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OCTRACE_BOX8_INL
#undef OCTRACE_BOX8_INL
#else
#define OCTRACE_BOX8_INL
#endif

#include "backend/octree/binary_tree.h"
#include "backend/octree/eight-inl.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::octree::HWY_NAMESPACE {

const hn::CappedTag<float, 4> kHalfTag;

// A box: lower corner in words 0 to 2, negated upper corner in words 4 to 6.
using Box8 = Eight;

// Words 4 to 7 before words 0 to 3.
HWY_ATTR HWY_INLINE Box8 swapped(const Box8& a) {
  Box8 v;
#if HWY_MAX_BYTES >= 32 && HWY_TARGET != HWY_SCALAR
  v.part[0] = hn::ConcatLowerUpper(kTag, a.part[0], a.part[0]);
#else
  for (std::size_t i = 0; i < kParts; ++i) v.part[i] = a.part[(i + kParts / 2) % kParts];
#endif
  return v;
}
// Twice the centre in words 0 to 2, its negative in words 4 to 6.
HWY_ATTR HWY_INLINE Box8 centre(const Box8& a) {
  const Box8 other = swapped(a);
  Box8 v;
  for (std::size_t i = 0; i < kParts; ++i) v.part[i] = hn::Sub(a.part[i], other.part[i]);
  return v;
}
HWY_ATTR HWY_INLINE float half_area(const Box8& a) {
  alignas(32) float v[8];
  store(a, v);
  const float x = -v[4] - v[0], y = -v[5] - v[1], z = -v[6] - v[2];
  return x * y + y * z + z * x;
}

HWY_ATTR HWY_INLINE Box8 load(const Reference& reference) { return load(reference.lower); }
HWY_ATTR HWY_INLINE Box8 load(const LooseReference& reference) {
  Box8 v;
  for (std::size_t i = 0; i < kParts; ++i) {
    v.part[i] = hn::LoadU(kTag, reference.lower + i * kLanes);
  }
  return v;
}

template <class R>
HWY_ATTR HWY_INLINE Bounds8 bounds_of(const R* references, std::uint32_t count) {
  Box8 box = infinities(), centres = infinities();
  for (std::uint32_t i = 0; i < count; ++i) {
    const Box8 v = load(references[i]);
    box = lesser(box, v);
    centres = lesser(centres, centre(v));
  }
  Bounds8 bounds;
  store(box, bounds.box);
  store(centres, bounds.centres);
  return bounds;
}

}  // namespace octrace::octree::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // once for each instruction set
