// The octree builder on the GPU: its memory and the order of its stages.
#include "kernels/cuda/build/stages.h"

namespace octrace::kernels::cuda {

std::uint64_t lay_out(std::uint64_t triangles, std::uint64_t node_capacity, void* memory,
                      BuildScratch* scratch) {
  std::uint64_t bytes = 0;
  const auto place = [&](auto*& array, std::uint64_t count) {
    array = reinterpret_cast<std::remove_reference_t<decltype(array)>>(static_cast<char*>(memory) +
                                                                       bytes);
    bytes += (count * sizeof *array + 255) / 256 * 256;
  };
  place(scratch->counters, 1);
  place(scratch->keys, triangles);
  place(scratch->sorted_keys, triangles);
  place(scratch->ids, triangles);
  place(scratch->sorted_ids, triangles);
  place(scratch->binary, 2 * triangles);
  place(scratch->sizes, triangles);
  place(scratch->plans, triangles);
  place(scratch->clusters, triangles);
  place(scratch->parents, triangles);
  place(scratch->tasks, node_capacity);
  char* sort = nullptr;
  scratch->sort_bytes = sort_bytes(triangles);
  place(sort, scratch->sort_bytes);
  scratch->sort = sort;
  return bytes;
}

std::uint64_t build_node_capacity(std::uint64_t triangles) {
  // A node with no inner child has at least four triangles, and a node with room for s more
  // children has no inner child of fewer than s + 2, or that would have been opened. Real scenes
  // stay under a third; should one pass a half, the build fails.
  return triangles / 2 + 2;
}

std::uint64_t build_scratch_bytes(std::uint64_t triangles) {
  BuildScratch scratch{};
  return lay_out(triangles, build_node_capacity(triangles), nullptr, &scratch);
}

Status launch_build(const BuildScene& scene, void* memory, const BuildTarget& target,
                    Stream stream) {
  BuildScratch scratch{};
  lay_out(scene.triangles.size, target.node_capacity, memory, &scratch);
  const cudaStream_t queue = static_cast<cudaStream_t>(stream);
  if (Status s = launch_curve(scene, scratch, queue); !s.ok()) return s;
  const std::uint32_t count = static_cast<std::uint32_t>(scene.triangles.size);
  if (Status s = launch_binary(count, scratch, queue); !s.ok()) return s;
  return launch_collapse(scene, scratch, target, queue);
}

}  // namespace octrace::kernels::cuda
