#include "backend/octree/collapse.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <memory>
#include <vector>

#include "backend/octree/blocks.h"
#include "backend/octree/node_writer.h"
#include "backend/octree/plan.h"

namespace octrace::octree {

namespace {

using kernels::kChildren;

constexpr std::uint32_t kParallel = 4096;  // references worth a task

// A subtree's nodes, the root first, whose children and triangles are counted from 0, and the
// triangles that their leaves hold.
struct Draft {
  const kernels::Node* nodes = nullptr;
  const std::uint32_t* triangles = nullptr;
  Blocks<kernels::Node>::Block nodes_block{};
  Blocks<std::uint32_t>::Block triangles_block{};
};

struct Size {
  std::uint32_t nodes = 0, triangles = 0;
  int height = 0;
};

// A large eight-way node, and what is below it.
struct Plot {
  Family family;
  std::array<Size, kChildren> sizes;  // of inner children's subtrees
  std::array<std::unique_ptr<Plot>, kChildren> plots;
  std::array<Draft, kChildren> drafts;  // of children without a plot
  Size size;

  explicit Plot(const Family& of) : family(of) {}
};

// Subtrees are drafted by threads, each in its own memory, since their places are known only when
// all sizes are; then they are copied to places that do not depend on threads.
class Writer {
 public:
  Writer(BinaryTree& tree, const BuildInput& input, Octree& octree)
      : tree_(tree), nodes_(tree.nodes.data()), input_(input), octree_(octree) {}

  bool run() {
    std::unique_ptr<Plot> root = survey(BinaryTree::kRoot, 1);
    if (root->size.height > kernels::kMaxDepth) return false;
    octree_.nodes.resize(root->size.nodes);
    octree_.triangles.resize(root->size.triangles);
    const NodeWriter writer(nodes_, input_, octree_.nodes.data(), octree_.triangles.data());
    write(writer, *root, 0, {1, 0});
    root.reset();
    // The rest of the octree takes its place in memory. Assignment of {} would keep it.
    decltype(tree_.nodes)().swap(tree_.nodes);
    tbb::parallel_for(std::size_t{0}, jobs_.size(), [&](std::size_t i) { copy(jobs_[i]); });
    return true;
  }

 private:
  static constexpr int kTooHigh = kernels::kMaxDepth + 1;

  using Place = NodeWriter::Place;

  struct Desk {
    Blocks<kernels::Node> nodes{4 * kParallel};
    Blocks<std::uint32_t> triangles{16 * kParallel};
  };

  struct Job {
    Draft draft;
    Size size;
    std::uint32_t root;  // where its root goes
    Place place;         // where what is below goes
  };

  bool leaf(std::uint32_t index) const { return is_leaf(nodes_[index]); }

  std::uint32_t leaf_size(std::uint32_t index) const {
    const BinaryNode& node = nodes_[index];
    return node.leaf() ? 1 : leaf_size(2 * node.child) + leaf_size(2 * node.child + 1);
  }

  std::unique_ptr<Plot> survey(std::uint32_t index, int depth) {
    auto plot = std::make_unique<Plot>(Family(nodes_, index));
    plot->size = {1, 0, depth};
    if (depth >= kernels::kMaxDepth) {
      plot->size.height = kTooHigh;
      return plot;
    }
    tbb::parallel_for(0, plot->family.count, [&](int i) {
      const std::uint32_t child = plot->family.index[i];
      if (leaf(child)) {
        plot->sizes[i] = {0, leaf_size(child), 0};
      } else if (about_count(nodes_[child].plan) < kParallel) {
        plot->sizes[i] = draft(child, plot->drafts[i]);
        plot->sizes[i].height += depth;
      } else {
        plot->plots[i] = survey(child, depth + 1);
        plot->sizes[i] = plot->plots[i]->size;
      }
    });
    for (int i = 0; i < plot->family.count; ++i) {
      plot->size.nodes += plot->sizes[i].nodes;
      plot->size.triangles += plot->sizes[i].triangles;
      plot->size.height = std::max(plot->size.height, plot->sizes[i].height);
    }
    return plot;
  }

  // Fewer than kParallel references are below, and so no more nodes: every one has two children or
  // more.
  Size draft(std::uint32_t root, Draft& draft) {
    Desk& desk = desks_.local();
    kernels::Node* const nodes = desk.nodes.reserve(kParallel);
    std::uint32_t* const triangles = desk.triangles.reserve(kParallel);
    Place place{1, 0};
    const int height = NodeWriter(nodes_, input_, nodes, triangles).write_all(root, 0, place);
    draft = {nodes, triangles, desk.nodes.use(place.node), desk.triangles.use(place.triangle)};
    return {place.node, place.triangle, height};
  }

  // Depth first: a node's inner children side by side, in the order of slots, and after them what
  // is below each.
  void write(const NodeWriter& writer, const Plot& plot, std::uint32_t index, Place place) {
    std::array<std::uint8_t, kChildren> order;
    std::uint32_t child = place.node;
    const int inner = writer.write(plot.family, index, place, order);
    for (int i = 0; i < inner; ++i, ++child) {
      const Size& size = plot.sizes[order[i]];
      if (plot.plots[order[i]] != nullptr) {
        write(writer, *plot.plots[order[i]], child, place);
      } else {
        jobs_.push_back({plot.drafts[order[i]], size, child, place});
      }
      place.node += size.nodes - 1;
      place.triangle += size.triangles;
    }
  }

  // Gives the draft's memory back.
  void copy(Job& job) {
    copy_subtree(job.draft.nodes, job.size.nodes, octree_.nodes.data(), octree_.nodes[job.root],
                 job.place);
    write_triangles(input_, job.draft.triangles, job.size.triangles,
                    octree_.triangles.data() + job.place.triangle);
    job.draft = {};
  }

  BinaryTree& tree_;
  const BinaryNode* nodes_;
  const BuildInput& input_;
  Octree& octree_;
  tbb::enumerable_thread_specific<Desk> desks_;
  std::vector<Job> jobs_;
};

}  // namespace

bool collapse(BinaryTree& tree, std::uint32_t leaf_triangles, const BuildInput& input,
              Octree& octree) {
  return plan(tree.nodes.data(), leaf_triangles) && Writer(tree, input, octree).run();
}

}  // namespace octrace::octree
