// Many independent rays at once: a few walks are taken in turns, a step each, so that one's cache
// misses and latencies pass while the others work, and steps of one kind run in one loop, so that
// what a ray does next is no branch to be guessed. Included once for each instruction set.
#if defined(OCTRACE_STREAM_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OCTRACE_STREAM_INL
#undef OCTRACE_STREAM_INL
#else
#define OCTRACE_STREAM_INL
#endif

#include "kernels/cpu/wide_leaf-inl.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::kernels::HWY_NAMESPACE {

inline constexpr std::uint32_t kWalks = 16;

// The walks that wait for a step of one kind.
struct Queue {
  WideRay* walks[kWalks] = {};
  std::uint32_t size = 0;

  // The walks that wait now. Each enters one queue again, this one not before it has been read.
  OCTRACE_FORCE_INLINE std::uint32_t take() {
    const std::uint32_t taken = size;
    size = 0;
    return taken;
  }
};

// The first two are the highest bits of a WideRef. (Leaves have two.)
enum StepKind : std::uint32_t { kNodeStep, kDoneStep, kLeafStep, kTestStep, kStepKinds };

HWY_ATTR HWY_INLINE void enqueue(const WideView& tree, WideRay* walk, Queue* queues) {
  prefetch(tree, walk->ref);
  const std::uint32_t kind = walk->ref >> 30;
  Queue& queue = queues[kind < kLeafStep ? kind : kLeafStep];
  queue.walks[queue.size++] = walk;
}

// Calls store(index, ray) for each of rays[0, count) as it ends.
//
// A round takes every queue once, so that how long each loop runs is known before it begins: a
// branch on what a step has just found would be guessed, often wrongly, and found out late.
template <class Query, class Store>
HWY_ATTR HWY_INLINE void trace_stream(const WideView& from, const SceneView& scene,
                                      const RenderParams& params, const Ray* rays,
                                      std::uint32_t count, const Store& store) {
  const WideView tree = from;  // so that stores leave it in registers
  WideRay walks[kWalks];
  Queue queues[kStepKinds];
  Queue &nodes = queues[kNodeStep], &leaves = queues[kLeafStep];
  Queue &tests = queues[kTestStep], &done = queues[kDoneStep];
  std::uint32_t next = 0;
  for (; next < count && next < kWalks; ++next) {
    begin(tree, rays[next], next, walks[next]);
    enqueue(tree, &walks[next], queues);
  }
  while (nodes.size + leaves.size + done.size != 0) {
    std::uint32_t size = nodes.take();
    for (std::uint32_t i = 0; i < size; ++i) {
      WideRay* walk = nodes.walks[i];
      visit_node<!Query::kAnyHit>(tree, *walk);
      enqueue(tree, walk, queues);
    }
    size = leaves.take();
    for (std::uint32_t i = 0; i < size; ++i) {
      WideRay* walk = leaves.walks[i];
      const Candidates found = candidates<Query>(tree, params, *walk);
      const bool certain = found.certain != 0;
      const std::uint32_t left = certain ? 0 : found.likely;
      const std::uint32_t top = walk->depth - 1;
      const WideRef ref = certain ? kDoneRef : walk->stack_ref[top];
      if constexpr (Query::kAnyHit) walk->opacity = certain ? kOpacityBlocked : walk->opacity;
      const float t = walk->stack_t[top];
      walk->candidates = left;
      walk->depth = left == 0 ? top : top + 1;
      walk->ref = left == 0 ? ref : walk->ref;
      walk->t = left == 0 ? t : walk->t;
      prefetch(tree, ref);
      std::uint32_t kind = ref >> 30;
      kind = kind < kLeafStep ? kind : kLeafStep;
      Queue& queue = queues[left == 0 ? kind : kTestStep];
      queue.walks[queue.size++] = walk;
    }
    size = tests.take();
    for (std::uint32_t i = 0; i < size; ++i) {
      WideRay* walk = tests.walks[i];
      if (test<Query>(tree, scene, params, *walk, walk->candidates)) {
        walk->finish();
      } else {
        walk->pop();
      }
      enqueue(tree, walk, queues);
    }
    size = done.take();
    for (std::uint32_t i = 0; i < size; ++i) {
      WideRay* walk = done.walks[i];
      store(walk->index, *walk);
      if (next == count) continue;
      begin(tree, rays[next], next, *walk);
      ++next;
      enqueue(tree, walk, queues);
    }
  }
}

}  // namespace octrace::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
