// Threads share nothing while they build subtrees: range [first, first + count) of the references
// is replaced by the same range of leaf triangles, since each triangle lies in one leaf, and nodes
// wait in the memory of their thread until all sizes are known. Then the top is planned and
// written, and subtrees are copied to places that do not depend on threads: depth first, as all
// other trees.
#include "backend/octree/build_subtrees.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>

#include "backend/octree/blocks.h"
#include "backend/octree/node_writer.h"
#include "backend/octree/plan.h"

namespace octrace::octree {

namespace {

using kernels::kChildren;

// A subtree's nodes, the root first; children are named by their places here.
struct Chunk {
  const kernels::Node* nodes = nullptr;
  std::uint32_t size = 0;
  int height = 0;
};

class Workplace {
 public:
  Workplace()
      : nodes_(std::make_unique_for_overwrite<BinaryNode[]>(2 * kMostInSubtree)),
        local_(std::make_unique_for_overwrite<LocalTriangle[]>(kMostInSubtree)) {}

  // Returns the subtree's cost in one slot.
  float build(const TopRange& range, const TopOptions& options, std::uint32_t leaf_triangles,
              const BuildInput& input, const LooseReference* references,
              kernels::LeafTriangle* triangles, Chunk& chunk) {
    room_.build(range, options, references, nodes_.get(), local_.get());
    const float cost = plan_subtree(nodes_.get(), leaf_triangles);
    // Every node but a subtree's root has two children or more, so there are not more of them.
    kernels::Node* const to = written_.reserve(range.count);
    NodeWriter::Place place{1, range.first};
    chunk.height = NodeWriter(nodes_.get(), input, local_.get(), to, triangles)
                       .write_all(BinaryTree::kRoot, 0, place);
    chunk.nodes = to;
    chunk.size = place.node;
    written_.use(place.node);
    return cost;
  }

 private:
  SubtreeRoom room_;
  std::unique_ptr<BinaryNode[]> nodes_;
  std::unique_ptr<LocalTriangle[]> local_;
  Blocks<kernels::Node, 2 * kMostInSubtree> written_;
};

class TopWriter {
 public:
  TopWriter(const std::vector<BinaryNode>& nodes, const std::vector<Chunk>& chunks,
            const BuildInput& input, Octree& octree)
      : nodes_(nodes), chunks_(chunks), input_(input), octree_(octree), sizes_(nodes.size()) {}

  bool run() {
    if (measure(BinaryTree::kRoot, 1) > kernels::kMaxDepth) return false;
    octree_.nodes.resize(sizes_[BinaryTree::kRoot]);
    const NodeWriter writer(nodes_.data(), input_, octree_.nodes.data(), octree_.triangles.data());
    write(writer, BinaryTree::kRoot, 0, 1);
    tbb::parallel_for(std::size_t{0}, jobs_.size(), [&](std::size_t i) { copy(jobs_[i]); });
    return true;
  }

 private:
  // Where a subtree goes: its root, and what is below that.
  struct Job {
    std::uint32_t subtree, root, below;
  };

  // Counts the eight-way nodes. Returns the depth of the lowest.
  int measure(std::uint32_t index, int depth) {
    if (depth > kernels::kMaxDepth) return depth;
    if (nodes_[index].leaf()) {
      const Chunk& chunk = chunks_[nodes_[index].triangle()];
      sizes_[index] = chunk.size;
      return depth + chunk.height - 1;
    }
    const Family family(nodes_.data(), index);
    sizes_[index] = 1;
    int lowest = depth;
    for (int i = 0; i < family.count; ++i) {
      lowest = std::max(lowest, measure(family.index[i], depth + 1));
      sizes_[index] += sizes_[family.index[i]];
    }
    return lowest;
  }

  void write(const NodeWriter& writer, std::uint32_t index, std::uint32_t at, std::uint32_t below) {
    const Family family(nodes_.data(), index);
    std::array<std::uint8_t, kChildren> order;
    NodeWriter::Place place{below, 0};
    const int inner = writer.write(family, at, place, order);
    for (int i = 0; i < inner; ++i, ++below) {
      const std::uint32_t child = family.index[order[i]];
      if (nodes_[child].leaf()) {
        jobs_.push_back({nodes_[child].triangle(), below, place.node});
      } else {
        write(writer, child, below, place.node);
      }
      place.node += sizes_[child] - 1;
    }
  }

  void copy(const Job& job) {
    const Chunk& chunk = chunks_[job.subtree];
    copy_subtree(chunk.nodes, chunk.size, octree_.nodes.data(), job.root, {job.below, 0});
  }

  const std::vector<BinaryNode>& nodes_;
  const std::vector<Chunk>& chunks_;
  const BuildInput& input_;
  Octree& octree_;
  std::vector<std::uint32_t> sizes_;  // by binary node: eight-way nodes of its subtree
  std::vector<Job> jobs_;
};

// The top alone as a binary tree, whose leaves have the numbers of subtrees.
void list(const TopRange& range, std::uint32_t root, std::vector<BinaryNode>& nodes) {
  if (range.lower == nullptr) {
    write_node(nodes[root], range.bounds, BinaryNode::kLeaf | range.subtree, 0);
    return;
  }
  const auto pair = static_cast<std::uint32_t>(nodes.size() / 2);
  write_node(nodes[root], range.bounds, pair, 0);
  nodes.resize(nodes.size() + 2);
  list(*range.lower, 2 * pair, nodes);
  list(*range.upper, 2 * pair + 1, nodes);
}

}  // namespace

bool build_subtrees(const TopTree& top, const TopOptions& options, std::uint32_t leaf_triangles,
                    const BuildInput& input, const LooseReference* references, Octree& octree) {
  std::vector<Chunk> chunks(top.subtrees.size());
  std::vector<float> costs(top.subtrees.size());
  tbb::enumerable_thread_specific<Workplace> workplaces;
  tbb::parallel_for(std::size_t{0}, top.subtrees.size(), [&](std::size_t i) {
    costs[i] = workplaces.local().build(*top.subtrees[i], options, leaf_triangles, input,
                                        references, octree.triangles.data(), chunks[i]);
  });
  std::vector<BinaryNode> nodes(2);
  list(*top.root, BinaryTree::kRoot, nodes);
  plan_top(nodes.data(), costs.data());
  return TopWriter(nodes, chunks, input, octree).run();
}

}  // namespace octrace::octree
