#include "backend/octree/collapse.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <memory>

#include "backend/octree/node_writer.h"
#include "backend/octree/plan.h"

namespace octrace::octree {

namespace {

using kernels::kChildren;

constexpr std::uint32_t kParallel = 4096;  // references worth a task

struct Size {
  std::uint32_t nodes = 0, triangles = 0;
  int height = 0;
};

// A large eight-way node, and what is below it: sizes must be known before threads write.
struct Plot {
  Family family;
  std::array<Size, kChildren> sizes;                   // of inner children's subtrees
  std::array<std::unique_ptr<Plot>, kChildren> plots;  // null: small
  Size size;

  explicit Plot(const Family& of) : family(of) {}
};

class Writer {
 public:
  Writer(const BinaryTree& tree, const BuildInput& input, Octree& octree)
      : nodes_(tree.nodes.data()), input_(input), octree_(octree) {}

  bool run() {
    const std::unique_ptr<Plot> root = survey(BinaryTree::kRoot, 1);
    if (root->size.height > kernels::kMaxDepth) return false;
    octree_.nodes.resize(root->size.nodes);
    octree_.triangles.resize(root->size.triangles);
    const NodeWriter writer(nodes_, input_, octree_.nodes.data(), octree_.triangles.data());
    write(writer, *root, 0, {1, 0});
    return true;
  }

 private:
  static constexpr int kTooHigh = kernels::kMaxDepth + 1;

  using Place = NodeWriter::Place;

  bool leaf(std::uint32_t index) const { return is_leaf(nodes_[index]); }

  std::uint32_t leaf_size(std::uint32_t index) const {
    const BinaryNode& node = nodes_[index];
    return node.leaf() ? 1 : leaf_size(2 * node.child) + leaf_size(2 * node.child + 1);
  }

  Size measure(std::uint32_t index, int depth) const {
    if (depth > kernels::kMaxDepth) return {0, 0, kTooHigh};
    const Family family(nodes_, index);
    Size size{1, 0, depth};
    for (int i = 0; i < family.count; ++i) {
      if (leaf(family.index[i])) {
        size.triangles += leaf_size(family.index[i]);
      } else {
        add(measure(family.index[i], depth + 1), size);
      }
    }
    return size;
  }
  static void add(const Size& below, Size& size) {
    size.nodes += below.nodes;
    size.triangles += below.triangles;
    size.height = std::max(size.height, below.height);
  }

  std::unique_ptr<Plot> survey(std::uint32_t index, int depth) const {
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
        plot->sizes[i] = measure(child, depth + 1);
      } else {
        plot->plots[i] = survey(child, depth + 1);
        plot->sizes[i] = plot->plots[i]->size;
      }
    });
    for (int i = 0; i < plot->family.count; ++i) add(plot->sizes[i], plot->size);
    return plot;
  }

  // Depth first: a node's inner children side by side, in the order of slots, and after them what
  // is below each.
  void write(const NodeWriter& writer, const Plot& plot, std::uint32_t index, Place place) {
    std::array<std::uint8_t, kChildren> order;
    const int inner = writer.write(plot.family, index, place, order);
    std::uint32_t child = octree_.nodes[index].first_child;
    struct Job {
      int of;
      std::uint32_t index;
      Place place;
    };
    std::array<Job, kChildren> jobs;
    for (int i = 0; i < inner; ++i) {
      jobs[i] = {order[i], child++, place};
      place.node += plot.sizes[order[i]].nodes - 1;
      place.triangle += plot.sizes[order[i]].triangles;
    }
    tbb::parallel_for(0, inner, [&](int i) {
      const Job& job = jobs[i];
      if (plot.plots[job.of] != nullptr) {
        write(writer, *plot.plots[job.of], job.index, job.place);
      } else {
        Place own = job.place;
        writer.write_all(plot.family.index[job.of], job.index, own);
      }
    });
  }

  const BinaryNode* nodes_;
  const BuildInput& input_;
  Octree& octree_;
};

}  // namespace

bool collapse(BinaryTree& tree, std::uint32_t leaf_triangles, const BuildInput& input,
              Octree& octree) {
  return plan(tree.nodes.data(), leaf_triangles) && Writer(tree, input, octree).run();
}

}  // namespace octrace::octree
