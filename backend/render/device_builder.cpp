#include "backend/render/device_builder.h"

#include <fmt/format.h>

namespace octrace::render {

namespace {

namespace cuda = kernels::cuda;

util::Error build_error(const cuda::Status& status, std::uint64_t bytes) {
  if (!status.out_of_memory()) return cuda_error(status);
  return {util::Exit::limit, "",
          fmt::format("building the octree on the GPU needs {} bytes of its memory: {}", bytes,
                      status.text),
          "", ""};
}

template <class T>
cuda::Status place(DeviceMemory& memory, std::span<const T> values, kernels::Span<T>& span) {
  if (cuda::Status s = memory.reserve(values.size_bytes()); !s.ok()) return s;
  span = {static_cast<const T*>(memory.data()), values.size()};
  if (values.empty()) return {};
  return cuda::copy_to_device(memory.data(), values.data(), values.size_bytes(), nullptr);
}

}  // namespace

util::Result<void> DeviceBuilder::load(const octree::BuildInput& input, int device) {
  const std::uint64_t triangles = input.triangles.size();
  const std::uint64_t capacity = cuda::build_node_capacity(triangles);
  const std::uint64_t bytes = cuda::build_scratch_bytes(triangles) +
                              capacity * sizeof(kernels::Node) +
                              triangles * sizeof(kernels::LeafTriangle);
  cuda::Status status = cuda::select_device(device);
  const auto then = [&](auto&& call) {
    if (status.ok()) status = call();
  };
  then([&] { return place(positions_, input.positions, scene_.positions); });
  then([&] { return place(triangles_, input.triangles, scene_.triangles); });
  then(
      [&] { return place(triangle_geometry_, input.triangle_geometry, scene_.triangle_geometry); });
  then([&] { return place(flags_, input.flags, scene_.flags); });
  then([&] { return scratch_.reserve(cuda::build_scratch_bytes(triangles)); });
  then([&] { return nodes_.reserve(capacity * sizeof(kernels::Node)); });
  then([&] { return leaf_triangles_.reserve(triangles * sizeof(kernels::LeafTriangle)); });
  then([&] { return report_.reserve(sizeof(cuda::BuildReport)); });
  if (begun_.get() == nullptr) {
    then([&] { return begun_.create(); });
    then([&] { return done_.create(); });
  }
  then([&] { return cuda::synchronize(nullptr); });
  return status.ok() ? util::Result<void>() : build_error(status, bytes);
}

util::Result<double> DeviceBuilder::build() {
  const cuda::BuildTarget target{
      static_cast<kernels::Node*>(nodes_.data()),
      static_cast<std::uint32_t>(cuda::build_node_capacity(scene_.triangles.size)),
      static_cast<kernels::LeafTriangle*>(leaf_triangles_.data()),
      static_cast<cuda::BuildReport*>(report_.data())};
  cuda::Status status = cuda::record_event(begun_.get(), nullptr);
  if (status.ok()) status = cuda::launch_build(scene_, scratch_.data(), target, nullptr);
  if (status.ok()) status = cuda::record_event(done_.get(), nullptr);
  if (status.ok()) {
    status = cuda::copy_to_host(&made_, report_.data(), sizeof made_, nullptr);
  }
  float milliseconds = 0.0f;
  if (status.ok()) status = cuda::synchronize(nullptr);
  if (status.ok()) status = cuda::elapsed(begun_.get(), done_.get(), &milliseconds);
  if (!status.ok()) return cuda_error(status);
  if (made_.failure != cuda::BuildFailure::none) {
    return util::Error{util::Exit::limit, "",
                       fmt::format("the octree built on the GPU would be deeper than {} levels",
                                   kernels::kMaxDepth),
                       "", ""};
  }
  return milliseconds * 1e-3;
}

util::Result<octree::Octree> DeviceBuilder::download() const {
  octree::Octree octree;
  octree.nodes.resize(made_.nodes);
  octree.triangles.resize(made_.triangles);
  cuda::Status status = cuda::copy_to_host(octree.nodes.data(), nodes_.data(),
                                           made_.nodes * sizeof(kernels::Node), nullptr);
  if (status.ok()) {
    status = cuda::copy_to_host(octree.triangles.data(), leaf_triangles_.data(),
                                made_.triangles * sizeof(kernels::LeafTriangle), nullptr);
  }
  if (status.ok()) status = cuda::synchronize(nullptr);
  if (!status.ok()) return cuda_error(status);
  return octree;
}

util::Result<octree::Octree> build_on_device(const octree::BuildInput& input, int device) {
  if (input.triangles.empty()) return octree::Octree{};
  DeviceBuilder builder;
  if (util::Result<void> loaded = builder.load(input, device); !loaded) return loaded.error();
  if (util::Result<double> built = builder.build(); !built) return built.error();
  return builder.download();
}

}  // namespace octrace::render
