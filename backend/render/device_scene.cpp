#include "backend/render/device_scene.h"

#include <fmt/format.h>

#include <chrono>
#include <cstddef>

namespace octrace::render {

namespace {

using kernels::Span;
using kernels::cuda::Status;

// One allocation holds every array; each starts at a multiple of what any load wants.
constexpr std::uint64_t kAlignment = 256;

std::uint64_t aligned(std::uint64_t bytes) {
  return (bytes + kAlignment - 1) / kAlignment * kAlignment;
}

// Calls visit(span) for every array of the view. One list serves sizes, copies and pointers.
template <class Visit>
void for_each_array(kernels::SceneView& view, Visit&& visit) {
  visit(view.octree.nodes);
  visit(view.octree.triangles);
  visit(view.positions);
  visit(view.triangles);
  visit(view.triangle_geometry);
  visit(view.geometries);
  visit(view.normals);
  visit(view.tangents);
  visit(view.uvs);
  visit(view.colors);
  visit(view.materials);
  visit(view.textures);
  visit(view.texels);
  visit(view.lights);
}

constexpr std::uint64_t kTableEntries = 256;

kernels::SceneView host_view(const scene::Scene& scene, const octree::Octree& octree) {
  kernels::SceneView view = scene.view();
  view.octree = octree.view();
  return view;
}

}  // namespace

util::Error cuda_error(const Status& status) {
  return {util::Exit::internal, "",
          fmt::format("CUDA failed while {}: {} ({})", status.call, status.text, status.name), "",
          ""};
}

std::uint64_t DeviceScene::bytes_needed(const scene::Scene& scene, const octree::Octree& octree) {
  kernels::SceneView view = host_view(scene, octree);
  std::uint64_t bytes = aligned(kTableEntries * sizeof(float));
  for_each_array(view, [&]<class T>(Span<T>& span) { bytes += aligned(span.size * sizeof(T)); });
  return bytes;
}

Status DeviceScene::upload(const scene::Scene& scene, const octree::Octree& octree) {
  const auto start = std::chrono::steady_clock::now();
  bytes_ = bytes_needed(scene, octree);
  Status status = memory_.reserve(bytes_);
  if (!status.ok()) return status;
  view_ = host_view(scene, octree);
  auto* next = static_cast<std::byte*>(memory_.data());
  const auto place = [&](const void* from, std::uint64_t bytes) -> const void* {
    void* to = next;
    if (status.ok() && bytes != 0) status = kernels::cuda::copy_to_device(to, from, bytes, nullptr);
    next += aligned(bytes);
    return to;
  };
  for_each_array(view_, [&]<class T>(Span<T>& span) {
    span.data = static_cast<const T*>(place(span.data, span.size * sizeof(T)));
  });
  view_.srgb_to_linear =
      static_cast<const float*>(place(view_.srgb_to_linear, kTableEntries * sizeof(float)));
  if (status.ok()) status = kernels::cuda::synchronize(nullptr);
  seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return status;
}

}  // namespace octrace::render
