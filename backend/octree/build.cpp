#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>

#include "backend/octree/builders.h"
#include "backend/octree/leaf_triangle.h"
#include "backend/octree/octree.h"
#include "backend/octree/tree.h"

namespace octrace::octree {

namespace {

constexpr std::uint32_t kPaperLeaf = 8;  // the threshold of the paper's experiment
constexpr std::uint32_t kParallelTriangles = 4096;

// Writes the tree into flat arrays, depth first: a node's inner children side by side, and below
// each its own subtree. Sizes of subtrees are known, so subtrees are written at the same time.
class Layout {
 public:
  Layout(const BuildInput& input, std::span<const std::uint32_t> ids, Octree& octree)
      : input_(input), ids_(ids), octree_(octree) {}

  void write(const TreeNode& root) {
    octree_.nodes.resize(root.subtree_nodes);
    octree_.triangles.resize(root.subtree_triangles);
    write_node(root, 0, 1, 0);
  }

 private:
  // `below` is where the nodes under this one begin; `triangle` where its leaf triangles do.
  void write_node(const TreeNode& tree, std::uint32_t index, std::uint32_t below,
                  std::uint32_t triangle) {
    kernels::Node& node = octree_.nodes[index];
    node = tree.node;
    node.first_child = below;
    node.first_triangle = triangle;
    for (int slot = 0; slot < kernels::kChildren; ++slot) {
      for (std::uint32_t i = 0; i < tree.leaf_count[slot]; ++i) {
        octree_.triangles[triangle++] = leaf_triangle(input_, ids_[tree.leaf_first[slot] + i]);
      }
    }
    struct Job {
      const TreeNode* tree;
      std::uint32_t index, below, triangle;
    };
    std::array<Job, kernels::kChildren> jobs;
    std::size_t count = 0;
    std::uint32_t next = below + static_cast<std::uint32_t>(std::popcount(node.inner_mask));
    for (const TreeNode* child : tree.children) {
      if (child == nullptr) continue;
      jobs[count] = {child, below + static_cast<std::uint32_t>(count), next, triangle};
      next += child->subtree_nodes - 1;
      triangle += child->subtree_triangles;
      ++count;
    }
    const auto run = [&](std::size_t i) {
      write_node(*jobs[i].tree, jobs[i].index, jobs[i].below, jobs[i].triangle);
    };
    if (tree.subtree_triangles < kParallelTriangles) {
      for (std::size_t i = 0; i < count; ++i) run(i);
    } else {
      tbb::parallel_for(std::size_t{0}, count, run);
    }
  }

  const BuildInput& input_;
  std::span<const std::uint32_t> ids_;
  Octree& octree_;
};

SahOptions sah_options(const BuildOptions& options) {
  constexpr std::uint32_t kMost = kernels::kMaxLeafTriangles;
  return {options.leaf == 0 ? kMost : std::min(options.leaf, kMost),
          options.builder == Builder::quality, options.cuts};
}

// Sizes of the largest arrays alive at once while building; an upper estimate.
std::uint64_t build_bytes(std::uint64_t triangles, const BuildOptions& options) {
  if (options.builder == Builder::median) {
    constexpr std::uint64_t kReference = 32, kTreeNodes = sizeof(TreeNode) / 4, kId = 4;
    return triangles * (kReference + kTreeNodes + kId + sizeof(kernels::LeafTriangle) +
                        sizeof(kernels::Node) / 4);
  }
  return sah_build_bytes(triangles, sah_options(options));
}

BuildInput input_of(const scene::Scene& scene, std::span<const std::uint32_t> flags) {
  return {scene.positions, scene.triangles, scene.triangle_geometry, flags};
}

}  // namespace

std::vector<std::uint32_t> geometry_flags(std::span<const kernels::Geometry> geometries,
                                          std::span<const kernels::Material> materials) {
  std::vector<std::uint32_t> flags;
  flags.reserve(geometries.size());
  for (const kernels::Geometry& geometry : geometries) {
    const kernels::Material& material = materials[geometry.material];
    flags.push_back((material.double_sided ? 0u : kernels::kCullBack) |
                    (material.alpha_mode == kernels::AlphaMode::mask ? kernels::kAlphaTest : 0u) |
                    (material.alpha_mode == kernels::AlphaMode::blend ? kernels::kBlend : 0u));
  }
  return flags;
}

std::vector<std::uint32_t> geometry_flags(const scene::Scene& scene) {
  return geometry_flags(scene.geometries, scene.materials);
}

const char* name_of(Builder builder) {
  switch (builder) {
    case Builder::median:
      return "median";
    case Builder::sah:
      return "sah";
    case Builder::quality:
      return "quality";
  }
  return "";
}

util::Result<Octree> build(const BuildInput& input, const BuildOptions& options) {
  const std::uint64_t needed = build_bytes(input.triangles.size(), options);
  if (input.triangles.size() > 0x7fffffffu || needed > options.max_bytes) {
    return util::Error{util::Exit::limit, "",
                       fmt::format("the octree of {} triangles needs about {} bytes while it is "
                                   "built; --max-scene-bytes is {}",
                                   input.triangles.size(), needed, options.max_bytes),
                       "", ""};
  }
  Octree octree;
  const auto run = [&] {
    if (options.builder != Builder::median) {
      build_sah(input, sah_options(options), octree);
      return;
    }
    TreeArena arena;
    std::vector<std::uint32_t> ids;
    const TreeNode* root =
        build_median(input, options.leaf == 0 ? kPaperLeaf : options.leaf, arena, ids);
    if (root != nullptr) Layout(input, ids, octree).write(*root);
  };
  if (options.threads == 0) {
    run();
  } else {
    // Without this, an arena gets no more threads than the machine has cores, and TBB says so.
    const tbb::global_control allow(
        tbb::global_control::max_allowed_parallelism,
        std::max<std::size_t>(options.threads,
                              static_cast<std::size_t>(tbb::info::default_concurrency())));
    tbb::task_arena(static_cast<int>(options.threads)).execute(run);
  }
  return octree;
}

util::Result<Octree> build(const scene::Scene& scene, const BuildOptions& options) {
  const std::vector<std::uint32_t> flags = geometry_flags(scene.geometries, scene.materials);
  util::Result<Octree> octree = build(input_of(scene, flags), options);
  if (!octree || !scene.instancing) return octree;
  util::Result<InstanceLevels> levels = build_instance_levels(scene, options);
  if (!levels) return levels.error();
  octree->instances = std::move(*levels);
  return octree;
}

util::Result<void> verify(const Octree& octree, const scene::Scene& scene) {
  const std::vector<std::uint32_t> flags = geometry_flags(scene.geometries, scene.materials);
  if (auto ok = verify(octree, input_of(scene, flags)); !ok) return ok;
  return verify_instance_levels(octree.instances, scene);
}

}  // namespace octrace::octree
