// Many independent rays at once: a few walks are taken in turns, a step each, so that one's cache
// misses and latencies pass while the others work, and steps of one kind run in one loop, so that
// what a ray does next is no branch to be guessed. Included once for each instruction set.
#if defined(OCTRACE_STREAM_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OCTRACE_STREAM_INL
#undef OCTRACE_STREAM_INL
#else
#define OCTRACE_STREAM_INL
#endif

#include "kernels/cpu/wide_walk-inl.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::kernels::HWY_NAMESPACE {

inline constexpr std::uint32_t kWalks = 16;

// The walks that wait for a step of one kind.
struct Queue {
  std::uint8_t walks[kWalks];
  std::uint32_t size;
};

// Queues by kind: the two highest bits of a WideRef. (Leaves have kDoneRef's bit free.)
enum StepKind : std::uint32_t { kNodeStep = 0, kDoneStep = 1, kLeafStep = 2 };

HWY_ATTR HWY_INLINE void enqueue(const WideView& tree, const WideRay& ray, std::uint32_t walk,
                                 Queue* queues) {
  prefetch(tree, ray.ref);
  Queue& queue = queues[ray.ref >> 30];
  queue.walks[queue.size++] = static_cast<std::uint8_t>(walk);
}

// Calls store(index, ray) for each of rays[0, count) as it ends.
template <class Query, class Store>
HWY_ATTR HWY_INLINE void trace_stream(const WideView& tree, const SceneView& scene,
                                      const RenderParams& params, const Ray* rays,
                                      std::uint32_t count, const Store& store) {
  WideRay walks[kWalks];
  Queue queues[4] = {};
  std::uint32_t next = 0;
  for (; next < count && next < kWalks; ++next) {
    begin(tree, rays[next], next, walks[next]);
    enqueue(tree, walks[next], next, queues);
  }
  Queue &nodes = queues[kNodeStep], &leaves = queues[kLeafStep], &done = queues[kDoneStep];
  while (nodes.size + leaves.size + done.size != 0) {
    // A queue is read in front of where it is written: every walk read enters one queue again.
    std::uint32_t size = nodes.size;
    nodes.size = 0;
    for (std::uint32_t i = 0; i < size; ++i) {
      const std::uint32_t walk = nodes.walks[i];
      visit_node(tree, walks[walk]);
      pop(walks[walk]);
      enqueue(tree, walks[walk], walk, queues);
    }
    size = leaves.size;
    leaves.size = 0;
    for (std::uint32_t i = 0; i < size; ++i) {
      const std::uint32_t walk = leaves.walks[i];
      if (visit_leaf<Query>(tree, scene, params, walks[walk])) walks[walk].depth = 1;
      pop(walks[walk]);
      enqueue(tree, walks[walk], walk, queues);
    }
    size = done.size;
    done.size = 0;
    for (std::uint32_t i = 0; i < size; ++i) {
      const std::uint32_t walk = done.walks[i];
      store(walks[walk].index, walks[walk]);
      if (next == count) continue;
      begin(tree, rays[next], next, walks[walk]);
      ++next;
      enqueue(tree, walks[walk], walk, queues);
    }
  }
}

}  // namespace octrace::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
