#include "backend/gltf/meshopt.h"

#include <fmt/format.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <vector>

#include "backend/util/checked.h"

namespace octrace::gltf {
namespace {

using Mode = MeshoptView::Mode;
using Filter = MeshoptView::Filter;

// The fewest bytes that `view` can be coded in (the extension's appendix A), so that a short stream
// cannot ask for much memory: 64 times its size for attributes, 12 for triangles, 4 for indices.
std::uint64_t fewest_bytes(const MeshoptView& view) {
  switch (view.mode) {
    case Mode::attributes: {
      // A header byte, a baseline element padded to 32 bytes and, a block of elements and a byte of
      // an element, two bits for each group of 16.
      const std::uint64_t block =
          std::min<std::uint64_t>(8192 / view.byte_stride & ~std::uint64_t{15}, 256);
      const auto headers = [&](std::uint64_t elements) {
        return view.byte_stride * (((elements + 15) / 16 + 3) / 4);
      };
      const std::uint64_t rest = view.count % block;
      return 1 + std::max<std::uint64_t>(view.byte_stride, 32) +
             view.count / block * headers(block) + (rest > 0 ? headers(rest) : 0);
    }
    case Mode::triangles:
      return 1 + view.count / 3 + 16;
    case Mode::indices:
      return 1 + view.count + 4;
  }
  return 0;
}

int decode(const MeshoptView& view, const unsigned char* from, void* to) {
  const auto count = static_cast<std::size_t>(view.count);
  const auto stride = static_cast<std::size_t>(view.byte_stride);
  const auto length = static_cast<std::size_t>(view.byte_length);
  switch (view.mode) {
    case Mode::attributes:
      return meshopt_decodeVertexBuffer(to, count, stride, from, length);
    case Mode::triangles:
      return meshopt_decodeIndexBuffer(to, count, stride, from, length);
    case Mode::indices:
      return meshopt_decodeIndexSequence(to, count, stride, from, length);
  }
  return -1;
}

void filter(const MeshoptView& view, void* data) {
  const auto count = static_cast<std::size_t>(view.count);
  const auto stride = static_cast<std::size_t>(view.byte_stride);
  switch (view.filter) {
    case Filter::none:
      break;
    case Filter::octahedral:
      meshopt_decodeFilterOct(data, count, stride);
      break;
    case Filter::quaternion:
      meshopt_decodeFilterQuat(data, count, stride);
      break;
    case Filter::exponential:
      meshopt_decodeFilterExp(data, count, stride);
      break;
  }
}

void decode_view(tinygltf::Model& model, const MeshoptView& view, Issues& issues) {
  const std::string pointer =
      fmt::format("/bufferViews/{}/extensions/EXT_meshopt_compression", view.view);
  const std::uint64_t fewest = fewest_bytes(view);
  if (view.byte_length < fewest) {
    issues.invalid("MESHOPT_DATA_INVALID", pointer,
                   fmt::format("{} elements of {} bytes need {} compressed bytes or more, has {}",
                               view.count, view.byte_stride, fewest, view.byte_length));
    return;
  }
  const auto& source = model.buffers[view.buffer].data;
  tinygltf::Buffer decoded;
  decoded.data.resize(static_cast<std::size_t>(view.count * view.byte_stride));
  const int failed = decode(view, source.data() + view.byte_offset, decoded.data.data());
  if (failed != 0) {
    issues.invalid("MESHOPT_DATA_INVALID", pointer,
                   fmt::format("{} bytes do not decode to {} elements of {} bytes ({})",
                               view.byte_length, view.count, view.byte_stride,
                               failed == -1   ? "wrong header"
                               : failed == -2 ? "they end too early"
                                              : "bytes are left over"));
    return;
  }
  filter(view, decoded.data.data());
  auto& shown = model.bufferViews[view.view];
  shown.buffer = static_cast<int>(model.buffers.size());
  shown.byteOffset = 0;
  model.buffers.push_back(std::move(decoded));
}

// Compressed bytes that nothing else shows are done with.
void free_compressed(Structure& structure) {
  std::vector<bool> shown(structure.model.buffers.size());
  for (const auto& view : structure.model.bufferViews) {
    shown[static_cast<std::size_t>(view.buffer)] = true;
  }
  for (const MeshoptView& view : structure.meshopt) {
    if (!shown[view.buffer]) structure.model.buffers[view.buffer].data = {};
  }
}

}  // namespace

void decode_meshopt(Structure& structure, const util::Limits& limits, Issues& issues) {
  if (structure.meshopt.empty()) return;
  std::uint64_t total = 0;
  for (const MeshoptView& view : structure.meshopt) {
    const auto sum = util::checked_add(total, view.count * view.byte_stride);  // below 2^31 * 2^8
    if (!sum || *sum > limits.max_scene_bytes) {
      issues.fail(util::Exit::limit, "LIMIT", fmt::format("/bufferViews/{}", view.view),
                  fmt::format("the compressed views up to this one decode to {} bytes, "
                              "--max-scene-bytes allows {}",
                              sum.value_or(UINT64_MAX), limits.max_scene_bytes));
      return;
    }
    total = *sum;
  }
  for (const MeshoptView& view : structure.meshopt) {
    decode_view(structure.model, view, issues);
    if (issues.failed()) return;
  }
  free_compressed(structure);
}

}  // namespace octrace::gltf
