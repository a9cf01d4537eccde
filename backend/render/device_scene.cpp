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

template <class Visit>
void for_each_geometry_array(kernels::SceneView& view, Visit&& visit) {
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
}

// Calls visit(span) for every array of the view. One list serves sizes, copies and pointers.
template <class Visit>
void for_each_array(kernels::InstancedSceneView& view, Visit&& visit) {
  for_each_geometry_array(view, visit);
  for_each_geometry_array(view.meshes, visit);
  visit(view.top.nodes);
  visit(view.top.triangles);
  visit(view.roots);
  visit(view.instances);
  visit(view.materials);
  visit(view.textures);
  visit(view.texels);
  visit(view.lights);
}

constexpr std::uint64_t kTableEntries = 256;

// What meshes have from the scene that shows them.
void share_surfaces(kernels::InstancedSceneView& view) {
  view.meshes.materials = view.materials;
  view.meshes.textures = view.textures;
  view.meshes.texels = view.texels;
  view.meshes.lights = view.lights;
  view.meshes.srgb_to_linear = view.srgb_to_linear;
}

}  // namespace

util::Error cuda_error(const Status& status) {
  return {util::Exit::internal, "",
          fmt::format("CUDA failed while {}: {} ({})", status.call, status.text, status.name), "",
          ""};
}

std::uint64_t DeviceScene::bytes_needed(const scene::Scene& scene, const octree::Octree& octree) {
  kernels::InstancedSceneView view = octree::instanced_view(scene, octree);
  std::uint64_t bytes = aligned(kTableEntries * sizeof(float));
  for_each_array(view, [&]<class T>(Span<T>& span) { bytes += aligned(span.size * sizeof(T)); });
  return bytes;
}

Status DeviceScene::upload(const scene::Scene& scene, const octree::Octree& octree) {
  const auto start = std::chrono::steady_clock::now();
  bytes_ = bytes_needed(scene, octree);
  Status status = memory_.reserve(bytes_);
  if (!status.ok()) return status;
  view_ = octree::instanced_view(scene, octree);
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
  share_surfaces(view_);
  if (status.ok()) status = kernels::cuda::synchronize(nullptr);
  seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return status;
}

Status DeviceScene::update(const scene::Scene& scene, const octree::Octree& octree,
                           const scene::SceneChanges& changes) {
  const kernels::InstancedSceneView from = octree::instanced_view(scene, octree);
  const kernels::InstancedSceneView to = view_;
  if (from.octree.nodes.size != to.octree.nodes.size || from.lights.size != to.lights.size ||
      changes.instances) {
    return upload(scene, octree);
  }
  const auto start = std::chrono::steady_clock::now();
  Status status;
  const auto copy = [&]<class T>(bool changed, const Span<T>& host, const Span<T>& device) {
    if (!changed || host.empty() || !status.ok()) return;
    status = kernels::cuda::copy_to_device(const_cast<T*>(device.data), host.data,
                                           host.size * sizeof(T), nullptr);
  };
  copy(changes.geometry(), from.octree.nodes, to.octree.nodes);
  copy(changes.geometry(), from.octree.triangles, to.octree.triangles);
  copy(changes.positions, from.positions, to.positions);
  copy(changes.triangles, from.triangles, to.triangles);
  copy(changes.normals, from.normals, to.normals);
  copy(changes.tangents, from.tangents, to.tangents);
  copy(changes.uvs, from.uvs, to.uvs);
  copy(changes.colors, from.colors, to.colors);
  copy(changes.lights, from.lights, to.lights);
  view_.diagonal = from.diagonal;
  if (status.ok()) status = kernels::cuda::synchronize(nullptr);
  seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return status;
}

}  // namespace octrace::render
