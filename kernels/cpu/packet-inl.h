// Rays that lie close together, such as a camera's: one walk for all of them, over the nodes that
// the beam around them meets, and leaf triangles tested a ray a lane. Included once for each
// instruction set.
#if defined(OCTRACE_PACKET_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OCTRACE_PACKET_INL
#undef OCTRACE_PACKET_INL
#else
#define OCTRACE_PACKET_INL
#endif

#include "kernels/cpu/load_rays-inl.h"
#include "kernels/cpu/triangle_lanes-inl.h"
#include "kernels/cpu/wide_leaf-inl.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::kernels::HWY_NAMESPACE {

inline constexpr std::uint32_t kPacketVectors = 4;
inline constexpr std::uint32_t kPacketRays = 8 * kPacketVectors;

// A packet that needs more steps than this, of a node or half a triangle each, is not coherent
// enough: its rays cost less in a group.
inline constexpr std::uint32_t kPacketSteps = 80;

struct alignas(64) Packet {
  float origin[3][kPacketRays], direction[3][kPacketRays], inverse[3][kPacketRays];
  float row[3][3][kPacketRays];  // of the shear: row_x, row_y, row_z by axis
  float tmin[kPacketRays], tmax[kPacketRays];
  float t[kPacketRays], u[kPacketRays], v[kPacketRays];
  std::uint32_t triangle[kPacketRays];
  // The beam: bounds over the rays. Planes that are entered are seen from the origin that makes
  // the distance least, planes that are left from the one that makes it most.
  float enter_origin[3], leave_origin[3], least[3], most[3], slope[3];
  float beam_tmin, beam_tmax;
  // For rays of one origin: what candidates() in wide_leaf-inl.h keeps for one ray.
  bool one_origin;
  float edge, ahead;
  std::uint32_t octant, enter[3];
  alignas(32) float stack_t[kWideStack];
  alignas(32) WideRef stack_ref[kWideStack];

  SlabRay slab_ray(std::uint32_t i) const {
    return {Vec3(origin[0][i], origin[1][i], origin[2][i]), octant,
            Vec3(inverse[0][i], inverse[1][i], inverse[2][i])};
  }
  TriangleRay triangle_ray(std::uint32_t i) const {
    return {Vec3(row[0][0][i], row[0][1][i], row[0][2][i]),
            Vec3(row[1][0][i], row[1][1][i], row[1][2][i]),
            Vec3(row[2][0][i], row[2][1][i], row[2][2][i])};
  }
};

// make_slab_ray() and make_triangle_ray(), a ray a lane.
HWY_ATTR HWY_INLINE void prepare(Packet& p, std::uint32_t first) {
  const Floats d;
  using V = hn::Vec<Floats>;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  V dir[3];
  for (int axis = 0; axis < 3; ++axis) {
    const V x = dir[axis] = hn::Load(d, &p.direction[axis][first]);
    const V tiny = hn::Set(d, kTinyDirection);
    const V kept = hn::IfThenElse(hn::Lt(hn::Abs(x), tiny),
                                  hn::IfThenElse(hn::Lt(x, zero), hn::Neg(tiny), tiny), x);
    hn::Store(hn::Div(one, kept), d, &p.inverse[axis][first]);
  }
  const ShearLanes shear = make_shear(dir);
  for (int axis = 0; axis < 3; ++axis) {
    hn::Store(shear.row_x[axis], d, &p.row[0][axis][first]);
    hn::Store(shear.row_y[axis], d, &p.row[1][axis][first]);
    hn::Store(shear.row_z[axis], d, &p.row[2][axis][first]);
  }
}

// False: the rays' directions have different signs, so that no order of visits suits them all.
HWY_ATTR HWY_INLINE bool begin(const WideView& tree, const Ray* rays, std::uint32_t count,
                               Packet& p) {
  const Floats d;
  const auto zero = hn::Zero(d);
  std::uint32_t all[3] = {0xffu, 0xffu, 0xffu}, any[3] = {};  // lanes with a negative direction
  for (std::uint32_t first = 0; first < kPacketRays; first += 8) {
    const LoadedRays loaded = load_rays(rays, count, first);
    for (int axis = 0; axis < 3; ++axis) {
      hn::Store(loaded.origin[axis], d, p.origin[axis] + first);
      hn::Store(loaded.direction[axis], d, p.direction[axis] + first);
      const std::uint32_t negative = bits_of(hn::Lt(loaded.direction[axis], zero));
      all[axis] &= negative;
      any[axis] |= negative;
    }
    hn::Store(loaded.tmin, d, p.tmin + first);
    hn::Store(loaded.tmax, d, p.tmax + first);
    hn::Store(loaded.tmax, d, p.t + first);
    hn::Store(zero, d, p.u + first);
    hn::Store(zero, d, p.v + first);
    hn::Store(hn::Set(Words(), kNone), Words(), p.triangle + first);
  }
  p.octant = 0;
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    if (any[axis] != 0 && all[axis] != 0xffu) return false;
    p.octant |= (any[axis] & 1u) << axis;
  }
  for (std::uint32_t first = 0; first < kPacketRays; first += 8) prepare(p, first);
  const auto least = [&](const float* from) HWY_ATTR {
    auto v = hn::Load(d, from);
    for (std::uint32_t i = 8; i < kPacketRays; i += 8) v = hn::Min(v, hn::Load(d, from + i));
    return hn::GetLane(hn::MinOfLanes(d, v));
  };
  const auto most = [&](const float* from) HWY_ATTR {
    auto v = hn::Load(d, from);
    for (std::uint32_t i = 8; i < kPacketRays; i += 8) v = hn::Max(v, hn::Load(d, from + i));
    return hn::GetLane(hn::MaxOfLanes(d, v));
  };
  p.one_origin = true;
  float farthest = 0.0f;
  for (int axis = 0; axis < 3; ++axis) {
    const bool negative = (p.octant >> axis) & 1;
    const float lower = least(p.origin[axis]), upper = most(p.origin[axis]);
    p.one_origin &= lower == upper;
    farthest = greater(farthest,
                       greater(abs_of(tree.lower[axis] - lower), abs_of(tree.upper[axis] - lower)));
    p.enter_origin[axis] = negative ? lower : upper;
    p.leave_origin[axis] = negative ? upper : lower;
    p.least[axis] = least(p.inverse[axis]);
    p.most[axis] = most(p.inverse[axis]);
    p.slope[axis] = negative ? -p.least[axis] : p.most[axis];
    p.enter[axis] = static_cast<std::uint32_t>(axis) * 64 + (negative ? 32 : 0);
  }
  float largest = 0.0f, smallest = std::numeric_limits<float>::infinity();
  for (std::uint32_t first = 0; first < kPacketRays; first += 8) {
    const auto length = hn::Max(hn::Max(hn::Abs(hn::Load(d, p.direction[0] + first)),
                                        hn::Abs(hn::Load(d, p.direction[1] + first))),
                                hn::Abs(hn::Load(d, p.direction[2] + first)));
    largest = greater(largest, hn::GetLane(hn::MaxOfLanes(d, length)));
    smallest = lesser(smallest, hn::GetLane(hn::MinOfLanes(d, length)));
  }
  p.one_origin &= farthest * farthest * greater(farthest, largest) < 1e30f;
  p.edge = largest * 0x1p-16f;
  p.ahead = 0x1p-11f / smallest;
  p.beam_tmin = least(p.tmin);
  p.beam_tmax = most(p.tmax);
  return true;
}

// Which of eight boxes the beam meets, and where it enters them. Padded by 2^-19 times the farthest
// plane's distance: see wide_node.h.
template <class Vectors>
HWY_ATTR HWY_INLINE auto meet(const Packet& p, const Vectors& enter, const Vectors& leave,
                              float tmin, hn::Vec<Floats>* near_out) {
  const Floats d;
  using V = hn::Vec<Floats>;
  V in[3], out[3];
  V farthest = hn::Zero(d);
  for (int axis = 0; axis < 3; ++axis) {
    in[axis] = hn::Sub(enter[axis], hn::Set(d, p.enter_origin[axis]));
    out[axis] = hn::Sub(leave[axis], hn::Set(d, p.leave_origin[axis]));
    farthest = hn::Max(farthest, hn::Max(hn::Abs(in[axis]), hn::Abs(out[axis])));
  }
  const V padding = hn::Mul(farthest, hn::Set(d, kChildPadding));
  V near = hn::Set(d, tmin), far = hn::Set(d, p.beam_tmax);
  for (int axis = 0; axis < 3; ++axis) {
    const V least = hn::Set(d, p.least[axis]), most = hn::Set(d, p.most[axis]);
    const V widen = hn::Mul(padding, hn::Set(d, p.slope[axis]));
    near =
        hn::Max(near, hn::Sub(hn::Min(hn::Mul(in[axis], least), hn::Mul(in[axis], most)), widen));
    far =
        hn::Min(far, hn::Add(hn::Max(hn::Mul(out[axis], least), hn::Mul(out[axis], most)), widen));
  }
  *near_out = near;
  return hn::Le(near, far);
}

// candidates() of wide_leaf-inl.h, for rays of one origin: what all of them share, a triangle a
// lane.
struct LeafVolumes {
  alignas(32) float u[3][8], v[3][8], normal[3][8];
  alignas(32) float distance[8], edge[8], plane[8], ahead[8];
};

HWY_ATTR HWY_INLINE void prepare(const Packet& p, const float* rows, std::uint32_t n,
                                 LeafVolumes& to) {
  const Floats d;
  using V = hn::Vec<Floats>;
  const LeafReader row(rows, n);
  const V ax = row(0), ay = row(1), az = row(2);
  const V bx = hn::Sub(ax, row(3)), by = hn::Sub(ay, row(4)), bz = hn::Sub(az, row(5));
  const V cx = hn::Sub(row(6), ax), cy = hn::Sub(row(7), ay), cz = hn::Sub(row(8), az);
  const V ox = hn::Sub(ax, hn::Set(d, p.origin[0][0]));
  const V oy = hn::Sub(ay, hn::Set(d, p.origin[1][0]));
  const V oz = hn::Sub(az, hn::Set(d, p.origin[2][0]));
  const auto cross = [&](V xa, V ya, V za, V xb, V yb, V zb, float(*out)[8]) HWY_ATTR {
    hn::Store(hn::MulSub(ya, zb, hn::Mul(za, yb)), d, out[0]);
    hn::Store(hn::MulSub(za, xb, hn::Mul(xa, zb)), d, out[1]);
    hn::Store(hn::MulSub(xa, yb, hn::Mul(ya, xb)), d, out[2]);
  };
  cross(cx, cy, cz, ox, oy, oz, to.u);
  cross(bx, by, bz, ox, oy, oz, to.v);
  cross(cx, cy, cz, bx, by, bz, to.normal);
  hn::Store(
      hn::MulAdd(hn::Load(d, to.normal[0]), ox,
                 hn::MulAdd(hn::Load(d, to.normal[1]), oy, hn::Mul(hn::Load(d, to.normal[2]), oz))),
      d, to.distance);
  const V reach = row(kRowReach);
  const V far = hn::Add(reach, hn::Max(hn::Max(hn::Abs(ox), hn::Abs(oy)), hn::Abs(oz)));
  const V area = hn::Mul(reach, far);
  const V tiny = hn::Set(d, 1e-37f);
  hn::Store(hn::MulAdd(area, hn::Set(d, p.edge), tiny), d, to.edge);
  hn::Store(hn::MulAdd(hn::Mul(area, reach), hn::Set(d, 0x1p-15f), tiny), d, to.plane);
  hn::Store(hn::Mul(reach, hn::Set(d, p.ahead)), d, to.ahead);
}

// Whether any of eight rays may hit the triangle.
HWY_ATTR HWY_INLINE bool candidate(const Packet& p, std::uint32_t first, const LeafVolumes& of,
                                   std::uint32_t place) {
  const Floats d;
  using V = hn::Vec<Floats>;
  const V dx = hn::Load(d, p.direction[0] + first), dy = hn::Load(d, p.direction[1] + first);
  const V dz = hn::Load(d, p.direction[2] + first);
  const auto dot = [&](const float(*with)[8]) HWY_ATTR {
    return hn::MulAdd(
        hn::Set(d, with[0][place]), dx,
        hn::MulAdd(hn::Set(d, with[1][place]), dy, hn::Mul(hn::Set(d, with[2][place]), dz)));
  };
  const V volume = dot(of.normal), u = dot(of.u), v = dot(of.v);
  const V w = hn::Sub(hn::Sub(volume, u), v);
  const V edge = hn::Set(d, of.edge[place]), plane = hn::Set(d, of.plane[place]);
  const V ahead = hn::Set(d, of.ahead[place]);
  const V sign = hn::And(volume, hn::Set(d, -0.0f));
  const V distance = hn::Xor(hn::Set(d, of.distance[place]), sign);
  const V size = hn::Xor(volume, sign);
  const V from = hn::MulSub(size, hn::Sub(hn::Load(d, p.tmin + first), ahead), plane);
  const V to = hn::MulAdd(size, hn::Add(hn::Load(d, p.tmax + first), ahead), plane);
  const auto beside = hn::And(hn::Lt(hn::Min(hn::Min(u, v), w), hn::Neg(edge)),
                              hn::Gt(hn::Max(hn::Max(u, v), w), edge));
  const auto missed = hn::Or(beside, hn::Or(hn::Lt(distance, from), hn::Gt(distance, to)));
  return !hn::AllTrue(d, missed);
}

// intersect_triangle() for one triangle and eight rays from `first` on.
HWY_ATTR HWY_INLINE bool test(const SceneView& scene, const RenderParams& params, Packet& p,
                              std::uint32_t first, const float* rows, std::uint32_t n,
                              std::uint32_t place) {
  const Floats d;
  const Words du;
  using V = hn::Vec<Floats>;
  const auto of_ray = [&](const float* from) HWY_ATTR { return hn::Load(d, from + first); };
  const auto word = [&](std::uint32_t r) {
    std::uint32_t bits;
    __builtin_memcpy(&bits, &rows[r * n + place], sizeof bits);
    return bits;
  };
  const std::uint32_t id = word(kRowTriangle), flags = word(kRowFlags);
  const bool cull = ClosestQuery::culls(params, flags);
  RayLanes rays;
  TriangleLanes triangle;
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    rays.origin[axis] = of_ray(p.origin[axis]);
    rays.inverse[axis] = of_ray(p.inverse[axis]);
    rays.shear.row_x[axis] = of_ray(p.row[0][axis]);
    rays.shear.row_y[axis] = of_ray(p.row[1][axis]);
    rays.shear.row_z[axis] = of_ray(p.row[2][axis]);
    triangle.a[axis] = hn::Set(d, rows[axis * n + place]);
    triangle.b[axis] = hn::Set(d, rows[(3 + axis) * n + place]);
    triangle.c[axis] = hn::Set(d, rows[(6 + axis) * n + place]);
  }
  triangle.cull = hn::Lt(hn::Zero(d), hn::Set(d, cull ? 1.0f : 0.0f));
  const HitLanes found = intersect_lanes(rays, triangle);
  const V t = found.t;
  auto hit = hn::And(found.hit, hn::Ge(t, of_ray(p.tmin)));
  const V tmax = of_ray(p.tmax);
  // Of equal distances the lowest index counts; kNone is above all of them.
  const auto owner = hn::Load(du, p.triangle + first);
  const auto lower_id = hn::RebindMask(d, hn::Not(hn::Gt(hn::Set(du, id), owner)));
  hit = hn::And(hit, hn::Or(hn::Lt(t, tmax), hn::And(hn::Eq(t, tmax), lower_id)));
  const bool holes = (flags & kAlphaTest) != 0 && params.alpha != 0;
  bool changed = false;
  if (!holes && !hn::AllFalse(d, hit)) {
    changed = true;
    hn::Store(hn::IfThenElse(hit, t, tmax), d, p.tmax + first);
    hn::Store(hn::IfThenElse(hit, t, of_ray(p.t)), d, p.t + first);
    hn::Store(hn::IfThenElse(hit, hn::Div(found.weight_b, found.determinant), of_ray(p.u)), d,
              p.u + first);
    hn::Store(hn::IfThenElse(hit, hn::Div(found.weight_c, found.determinant), of_ray(p.v)), d,
              p.v + first);
    hn::Store(hn::IfThenElse(hn::RebindMask(du, hit), hn::Set(du, id), owner), du,
              p.triangle + first);
  }
  const auto singly = holes ? hn::Or(found.unsure, hit) : found.unsure;
  if (hn::AllFalse(d, singly)) return changed;
  std::uint8_t bits[8];
  hn::StoreMaskBits(d, singly, bits);
  for (std::uint32_t left = bits[0]; left != 0; left &= left - 1) {
    const std::uint32_t k = first + static_cast<std::uint32_t>(lowest_bit(left));
    const auto point = [&](std::uint32_t r) {
      return Vec3(rows[r * n + place], rows[(r + 1) * n + place], rows[(r + 2) * n + place]);
    };
    TriangleHit one;
    if (!intersect_triangle(p.slab_ray(k), p.triangle_ray(k), point(0), point(3), point(6),
                            p.tmin[k], p.tmax[k], cull, &one)) {
      continue;
    }
    if (one.t == p.tmax[k] && id > p.triangle[k]) continue;
    if (holes && !alpha_passes(scene, scene.triangle_geometry[id], id, one.u, one.v)) continue;
    p.tmax[k] = p.t[k] = one.t;
    p.u[k] = one.u;
    p.v[k] = one.v;
    p.triangle[k] = id;
    changed = true;
  }
  return changed;
}

// Returns the number of triangles tested.
HWY_ATTR HWY_INLINE std::uint32_t visit_leaf(const WideView& tree, const SceneView& scene,
                                             const RenderParams& params, WideRef leaf, float tmin,
                                             Packet& p) {
  const Floats d;
  using V = hn::Vec<Floats>;
  const std::uint32_t n = leaf_count(leaf);
  const float* rows = tree.leaf(leaf);
  const LeafReader row(rows, n);
  V enter[3], leave[3];
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    const V a = row(axis), b = row(3 + axis), c = row(6 + axis);
    const V lower = hn::Min(hn::Min(a, b), c), upper = hn::Max(hn::Max(a, b), c);
    const bool negative = (p.octant >> axis) & 1;
    enter[axis] = negative ? upper : lower;
    leave[axis] = negative ? lower : upper;
  }
  V near;
  std::uint8_t bits[8];
  hn::StoreMaskBits(d, meet(p, enter, leave, tmin, &near), bits);
  bool changed = false;
  const std::uint32_t tested = bits[0] & ((1u << n) - 1u);
  LeafVolumes volumes;
  if (p.one_origin && tested != 0) prepare(p, rows, n, volumes);
  for (std::uint32_t left = tested; left != 0; left &= left - 1) {
    const auto place = static_cast<std::uint32_t>(lowest_bit(left));
    for (std::uint32_t first = 0; first < kPacketRays; first += 8) {
      if (p.one_origin && !candidate(p, first, volumes, place)) continue;
      changed |= test(scene, params, p, first, rows, n, place);
    }
  }
  const auto count = static_cast<std::uint32_t>(count_bits(tested));
  if (!changed) return count;
  V most = hn::Load(d, p.tmax);
  for (std::uint32_t first = 8; first < kPacketRays; first += 8)
    most = hn::Max(most, hn::Load(d, p.tmax + first));
  p.beam_tmax = hn::GetLane(hn::MaxOfLanes(d, most));
  return count;
}

// By insertion: there are few. Of equal distances the last one comes first, as with single rays.
HWY_ATTR HWY_INLINE void sort_far_to_near(Packet& p, std::uint32_t first, std::uint32_t end) {
  for (std::uint32_t i = first + 1; i < end; ++i) {
    const float t = p.stack_t[i];
    const WideRef ref = p.stack_ref[i];
    std::uint32_t place = i;
    for (; place > first && p.stack_t[place - 1] < t; --place) {
      p.stack_t[place] = p.stack_t[place - 1];
      p.stack_ref[place] = p.stack_ref[place - 1];
    }
    p.stack_t[place] = t;
    p.stack_ref[place] = ref;
  }
}

// Closest hits of rays[0, count), count <= kPacketRays. False: they are too far apart for a packet,
// and no hits are written.
HWY_ATTR HWY_INLINE bool trace_packet(const WideView& tree, const SceneView& scene,
                                      const RenderParams& params, const Ray* rays,
                                      std::uint32_t count, Packet& p, Hit* hits) {
  if (!begin(tree, rays, count, p)) return false;
  const Floats d;
  const Words du;
  p.stack_t[0] = p.beam_tmin;
  p.stack_ref[0] = 0;
  std::uint32_t depth = 1;
  for (std::uint32_t steps = 0; depth != 0; ++steps) {
    if (steps > kPacketSteps) return false;
    --depth;
    const float tmin = p.stack_t[depth];
    const WideRef ref = p.stack_ref[depth];
    if (tmin > p.beam_tmax) continue;
    if (ref & kLeafRef) {
      steps += 2 * visit_leaf(tree, scene, params, ref, tmin, p);
      continue;
    }
    const WideNode& node = tree.node(ref);
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(&node);
    hn::Vec<Floats> enter[3], leave[3], near;
    for (int axis = 0; axis < 3; ++axis) {
      enter[axis] = hn::Load(d, reinterpret_cast<const float*>(bytes + p.enter[axis]));
      leave[axis] = hn::Load(d, reinterpret_cast<const float*>(bytes + (p.enter[axis] ^ 32)));
    }
    const auto met = meet(p, enter, leave, tmin, &near);
    const ToFront front(met);
    hn::StoreU(front(near), d, p.stack_t + depth);
    hn::StoreU(front(hn::Load(du, node.child)), du, p.stack_ref + depth);
    const std::uint32_t end = depth + static_cast<std::uint32_t>(hn::CountTrue(d, met));
    sort_far_to_near(p, depth, end);
    depth = end;
  }
  for (std::uint32_t i = 0; i < count; ++i) hits[i] = {p.t[i], p.u[i], p.v[i], p.triangle[i]};
  return true;
}

}  // namespace octrace::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
