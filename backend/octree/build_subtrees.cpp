// Threads share nothing while they build subtrees: range [first, first + count) of the references
// is replaced by as many leaf triangles. Those for which there is no reference in the array, as
// triangles were cut, and the nodes wait in the memory of their thread until all sizes are known.
// Then the top is planned and written, and subtrees are copied to places that do not depend on
// threads: depth first, as all other trees.
#include "backend/octree/build_subtrees.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <functional>
#include <numeric>
#include <unordered_set>
#include <utility>

#include "backend/octree/blocks.h"
#include "backend/octree/node_writer.h"
#include "backend/octree/plan.h"
#include "backend/octree/reinsert.h"
#include "backend/util/huge_memory.h"

namespace octrace::octree {

namespace {

using kernels::kChildren;

// A subtree's nodes, the root first; children and triangles are counted from 0.
struct Chunk {
  const kernels::Node* nodes = nullptr;
  std::uint32_t size = 0;
  int height = 0;
  Blocks<kernels::Node>::Block block{};             // where the nodes are
  std::unique_ptr<kernels::LeafTriangle[]> rest{};  // leaf triangles after as many as references
};

// What all subtrees share.
struct Subtrees {
  const TopOptions& options;
  ReinsertOptions reinsert;
  std::uint32_t leaf_triangles;
  const BuildInput& input;
  const LooseReference* references;
  kernels::LeafTriangle* triangles;
  std::uint32_t most;       // references of a subtree
  std::size_t block_nodes;  // of memory for the nodes of several subtrees
};

class Workplace {
 public:
  explicit Workplace(const Subtrees& all)
      : all_(all),
        nodes_(std::make_unique_for_overwrite<BinaryNode[]>(2 * std::size_t{all.most})),
        local_(std::make_unique_for_overwrite<LocalTriangle[]>(all.most)),
        // Every node but a subtree's root has two children or more, so there are not more of them.
        wide_(std::make_unique_for_overwrite<kernels::Node[]>(all.most)),
        written_(all.block_nodes) {}

  // Finds the subtree's cost in one slot as well. False: it is too deep.
  bool build(const TopRange& range, Chunk& chunk, float& cost) {
    const std::uint32_t rest = range.size - range.count;
    kernels::LeafTriangle* const own = all_.triangles + range.first;
    kernels::LeafTriangle* const leaves = rest == 0 ? own : more_triangles();
    if (!plan(range, cost)) return false;
    NodeWriter::Place place{1, 0};
    chunk.height = NodeWriter(nodes_.get(), all_.input, local_.get(), wide_.get(), leaves)
                       .write_all(BinaryTree::kRoot, 0, place);
    if (leaves != own) {
      std::copy_n(leaves, range.count, own);
      chunk.rest = std::make_unique_for_overwrite<kernels::LeafTriangle[]>(rest);
      std::copy_n(leaves + range.count, rest, chunk.rest.get());
    }
    kernels::Node* const nodes = written_.reserve(place.node);
    std::copy_n(wide_.get(), place.node, nodes);
    chunk.nodes = nodes;
    chunk.size = place.node;
    chunk.block = written_.use(place.node);
    return true;
  }

 private:
  // Re-insertion makes chains of some fans and stacks, which are better left as they were split.
  bool plan(const TopRange& range, float& cost) {
    constexpr int kMostReinserted = 32;  // binary levels
    room_.build(range, all_.options, all_.references, nodes_.get(), local_.get());
    if (reinsert(nodes_.get(), 2 * std::size_t{range.size}, all_.reinsert)) {
      if (plan_subtree(nodes_.get(), all_.leaf_triangles, kMostReinserted, cost)) return true;
      room_.build(range, all_.options, all_.references, nodes_.get(), local_.get());
    }
    return plan_subtree(nodes_.get(), all_.leaf_triangles, kMostBinaryLevels, cost);
  }

  kernels::LeafTriangle* more_triangles() {
    if (!triangles_) {
      triangles_ = std::make_unique_for_overwrite<kernels::LeafTriangle[]>(all_.most);
    }
    return triangles_.get();
  }

  const Subtrees& all_;
  SubtreeRoom room_;
  std::unique_ptr<BinaryNode[]> nodes_;
  std::unique_ptr<LocalTriangle[]> local_;
  std::unique_ptr<kernels::Node[]> wide_;  // until their number is known
  std::unique_ptr<kernels::LeafTriangle[]> triangles_;
  Blocks<kernels::Node> written_;
};

// The top as a binary tree whose leaves stand for ranges, and have their numbers.
class TopNodes {
 public:
  // `is_leaf`: which ranges are to be leaves; all that are not split are.
  template <class IsLeaf>
  TopNodes(const TopTree& top, const IsLeaf& is_leaf) : nodes_(2), ranges_(2) {
    list(*top.root, is_leaf, BinaryTree::kRoot);
  }

  BinaryNode* nodes() { return nodes_.data(); }
  std::size_t size() const { return nodes_.size(); }
  const TopRange& range(std::uint32_t node) const { return *ranges_[node]; }
  const std::vector<const TopRange*>& leaves() const { return leaves_; }

 private:
  template <class IsLeaf>
  void list(const TopRange& range, const IsLeaf& is_leaf, std::uint32_t root) {
    ranges_[root] = &range;
    if (range.lower == nullptr || is_leaf(range)) {
      const auto number = static_cast<std::uint32_t>(leaves_.size());
      write_node(nodes_[root], range.bounds, BinaryNode::kLeaf | number, 0);
      leaves_.push_back(&range);
      return;
    }
    const auto pair = static_cast<std::uint32_t>(nodes_.size() / 2);
    write_node(nodes_[root], range.bounds, pair, 0);
    nodes_.resize(nodes_.size() + 2);
    ranges_.resize(nodes_.size());
    list(*range.lower, is_leaf, 2 * pair);
    list(*range.upper, is_leaf, 2 * pair + 1);
  }

  std::vector<BinaryNode> nodes_;
  std::vector<const TopRange*> ranges_;  // by node
  std::vector<const TopRange*> leaves_;
};

class TopWriter {
 public:
  // Takes the chunks' memory.
  TopWriter(TopNodes& top, std::vector<Chunk>& chunks, const BuildInput& input, Octree& octree)
      : nodes_(top.nodes()),
        subtrees_(top.leaves()),
        chunks_(chunks),
        input_(input),
        octree_(octree),
        sizes_(top.size()),
        jobs_(chunks.size()) {}

  // `order`: in which subtrees were built, so that their memory is given back while that of the
  // octree is taken. False, and nothing taken: the octree would be too deep.
  bool run(const std::vector<std::uint32_t>& order) {
    if (measure(BinaryTree::kRoot, 1) > kernels::kMaxDepth) return false;
    place(BinaryTree::kRoot, 0, 1);
    spread_triangles();
    octree_.nodes.resize(sizes_[BinaryTree::kRoot]);
    tbb::parallel_for(std::size_t{0}, order.size(), [&](std::size_t i) { copy(order[i]); });
    for (const auto& [at, node] : top_) octree_.nodes[at] = node;
    for (const Job& job : jobs_) octree_.nodes[job.at] = job.root;
    return true;
  }

 private:
  // Where a subtree goes: its root, and what is below that.
  struct Job {
    std::uint32_t at = 0, below = 0;
    kernels::Node root{};  // once the rest is there
  };

  // Counts the eight-way nodes. Returns the depth of the lowest.
  int measure(std::uint32_t index, int depth) {
    if (depth > kernels::kMaxDepth) return depth;
    if (nodes_[index].leaf()) {
      const Chunk& chunk = chunks_[nodes_[index].triangle()];
      sizes_[index] = chunk.size;
      return depth + chunk.height - 1;
    }
    const Family family(nodes_, index);
    sizes_[index] = 1;
    int lowest = depth;
    for (int i = 0; i < family.count; ++i) {
      lowest = std::max(lowest, measure(family.index[i], depth + 1));
      sizes_[index] += sizes_[family.index[i]];
    }
    return lowest;
  }

  // The nodes above subtrees wait, as subtrees' roots do: they lie far apart, and each would take a
  // page of memory before its time.
  void place(std::uint32_t index, std::uint32_t at, std::uint32_t below) {
    if (nodes_[index].leaf()) {
      jobs_[nodes_[index].triangle()] = {at, below};
      return;
    }
    const Family family(nodes_, index);
    std::array<std::uint8_t, kChildren> order;
    NodeWriter::Place next{below, 0};
    kernels::Node node;
    const int inner =
        NodeWriter(nodes_, input_, &node, octree_.triangles.data()).write(family, 0, next, order);
    top_.emplace_back(at, node);
    for (int i = 0; i < inner; ++i, ++below) {
      const std::uint32_t child = family.index[order[i]];
      place(child, below, next.node);
      next.node += sizes_[child] - 1;
    }
  }

  void copy(std::uint32_t subtree) {
    Job& job = jobs_[subtree];
    Chunk& chunk = chunks_[subtree];
    copy_subtree(chunk.nodes, chunk.size, octree_.nodes.data(), job.root,
                 {job.below, subtrees_[subtree]->place});
    chunk.block.reset();
  }

  // Makes room in front of the leaf triangles for what others have more than references, from the
  // last to the first, since all move up.
  void spread_triangles() {
    octree_.triangles.resize(subtrees_.back()->place + subtrees_.back()->size);
    kernels::LeafTriangle* const triangles = octree_.triangles.data();
    for (std::size_t i = subtrees_.size(); i-- > 0;) {
      const TopRange& range = *subtrees_[i];
      if (range.place != range.first) {
        std::memmove(triangles + range.place, triangles + range.first,
                     range.count * sizeof(kernels::LeafTriangle));
      }
      std::copy_n(chunks_[i].rest.get(), range.size - range.count,
                  triangles + range.place + range.count);
      chunks_[i].rest.reset();
    }
  }

  const BinaryNode* const nodes_;
  const std::vector<const TopRange*>& subtrees_;
  std::vector<Chunk>& chunks_;
  const BuildInput& input_;
  Octree& octree_;
  std::vector<std::uint32_t> sizes_;  // by binary node: eight-way nodes of its subtree
  std::vector<Job> jobs_;             // by subtree
  std::vector<std::pair<std::uint32_t, kernels::Node>> top_;  // nodes above subtrees, by place
};

// Adds the topmost ranges that are small enough for a subtree, and are likely to be eight-way nodes
// in the cheapest tree; and units that are not, for want of a better one.
void add_subtrees(const TopNodes& top, const BinaryNode* nodes, std::uint32_t root,
                  std::uint32_t most, std::unordered_set<const TopRange*>& subtrees) {
  const TopRange& range = top.range(root);
  if (range.size <= most) {
    subtrees.insert(&range);
    return;
  }
  const Family family(nodes, root);
  for (int i = 0; i < family.count; ++i) add_subtrees(top, nodes, family.index[i], most, subtrees);
}

TopNodes choose_subtrees(const TopTree& top, std::uint32_t most) {
  TopNodes units(top, [](const TopRange&) { return false; });
  guess_top(units.nodes());  // no deeper than the splits
  std::unordered_set<const TopRange*> subtrees;
  add_subtrees(units, units.nodes(), BinaryTree::kRoot, most, subtrees);
  return TopNodes(top, [&](const TopRange& range) { return subtrees.contains(&range); });
}

// Blocks of a large page each, where every thread fills one, with so many references for each;
// smaller ones where those would stay empty.
std::size_t block_nodes(std::uint32_t references) {
  constexpr std::size_t kSmall = 2048, kLarge = util::kHugePage / sizeof(kernels::Node) + 1;
  constexpr std::size_t kReferences = 8;  // about so many have a node between them
  return references / kReferences >= kLarge ? kLarge : kSmall;
}

// The order in which subtrees are built: as they lie in memory, but first, and the largest before
// others, those of more than an eighth of what a thread has to build, lest one begins such a one
// when the others are done.
std::vector<std::uint32_t> building_order(const TopNodes& top, std::uint32_t references) {
  const auto size = [&](std::uint32_t i) { return top.leaves()[i]->size; };
  std::vector<std::uint32_t> order(top.leaves().size());
  std::iota(order.begin(), order.end(), 0u);
  const auto rest = std::stable_partition(
      order.begin(), order.end(), [&](std::uint32_t i) { return size(i) > references / 8; });
  std::stable_sort(order.begin(), rest,
                   [&](std::uint32_t a, std::uint32_t b) { return size(a) > size(b); });
  return order;
}

bool build_all(const TopNodes& top, const Subtrees& all, const std::vector<std::uint32_t>& order,
               std::vector<Chunk>& chunks, std::vector<float>& costs) {
  std::atomic<bool> built{true};
  std::atomic<std::size_t> next{0};
  tbb::enumerable_thread_specific<Workplace> workplaces(std::cref(all));
  tbb::parallel_for(std::size_t{0}, order.size(), [&](std::size_t) {
    const std::uint32_t i = order[next++];
    if (!workplaces.local().build(*top.leaves()[i], chunks[i], costs[i])) built = false;
  });
  return built;
}

}  // namespace

bool build_subtrees(const TopTree& top, const TopOptions& options, std::uint32_t leaf_triangles,
                    const BuildInput& input, const LooseReference* references, Octree& octree) {
  ReinsertOptions above, in_subtrees;
  above.rounds = in_subtrees.rounds = options.reinsert_rounds;
  above.steps = in_subtrees.steps = options.reinsert_steps;
  above.most = options.reinsert_most_above;
  in_subtrees.most = options.reinsert_most;
  in_subtrees.least_area = options.reinsert_area * top.root->bounds.half_area();
  in_subtrees.parallel = false;
  const std::uint32_t a_thread =
      top.root->size / static_cast<std::uint32_t>(tbb::this_task_arena::max_concurrency());
  // Enough subtrees for many threads, which need room for one each.
  const std::uint32_t most = std::clamp(top.root->size / 32, kMostInUnit, kMostInSubtree);
  TopNodes nodes = choose_subtrees(top, most);
  const Subtrees all{options, in_subtrees,          leaf_triangles,
                     input,   references,           octree.triangles.data(),
                     most,    block_nodes(a_thread)};
  std::vector<Chunk> chunks(nodes.leaves().size());
  std::vector<float> costs(chunks.size());
  const std::vector<std::uint32_t> order = building_order(nodes, a_thread);
  if (!build_all(nodes, all, order, chunks, costs)) return false;
  const auto finish = [&] {
    return plan_top(nodes.nodes(), costs.data()) &&
           TopWriter(nodes, chunks, input, octree).run(order);
  };
  const std::vector<BinaryNode> as_split(nodes.nodes(), nodes.nodes() + nodes.size());
  if (reinsert(nodes.nodes(), nodes.size(), above)) {
    if (finish()) return true;
    std::copy(as_split.begin(), as_split.end(), nodes.nodes());
  }
  return finish();
}

}  // namespace octrace::octree
