// Reading accessors against values written here, for every component type and layout.
#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

#include "backend/gltf/accessor.h"
#include "backend/gltf/document.h"

namespace octrace::gltf {
namespace {

// One accessor over bytes, without load(): these tests are about decoding alone.
struct Builder {
  Document document;

  int add_view(const std::vector<std::uint8_t>& bytes, std::size_t offset, std::size_t stride) {
    tinygltf::Buffer buffer;
    buffer.data = bytes;
    document.model.buffers.push_back(buffer);
    tinygltf::BufferView view;
    view.buffer = static_cast<int>(document.model.buffers.size()) - 1;
    view.byteOffset = offset;
    view.byteLength = bytes.size() - offset;
    view.byteStride = stride;
    document.model.bufferViews.push_back(view);
    return static_cast<int>(document.model.bufferViews.size()) - 1;
  }

  int add(int type, int component, std::size_t count, int view, bool normalized = false,
          std::size_t offset = 0) {
    tinygltf::Accessor accessor;
    accessor.type = type;
    accessor.componentType = component;
    accessor.count = count;
    accessor.bufferView = view;
    accessor.normalized = normalized;
    accessor.byteOffset = offset;
    document.model.accessors.push_back(accessor);
    return static_cast<int>(document.model.accessors.size()) - 1;
  }
};

template <class T>
std::vector<std::uint8_t> pack(std::initializer_list<T> values) {
  std::vector<std::uint8_t> bytes(values.size() * sizeof(T));
  std::memcpy(bytes.data(), values.begin(), bytes.size());
  return bytes;
}

std::vector<float> read_one(int type, int component, std::size_t count,
                            const std::vector<std::uint8_t>& bytes, bool normalized) {
  Builder builder;
  const int view = builder.add_view(bytes, 0, 0);
  return builder.document.read_floats(builder.add(type, component, count, view, normalized));
}

using Floats = std::vector<float>;

// glTF 2.0, 3.11: f = c / 127 and so on, with a floor of -1 for signed types.
TEST(Accessor, ComponentTypes) {
  const auto byte = pack<std::int8_t>({-128, -127, 0, 127});
  EXPECT_EQ(read_one(TINYGLTF_TYPE_VEC4, 5120, 1, byte, false), (Floats{-128, -127, 0, 127}));
  EXPECT_EQ(read_one(TINYGLTF_TYPE_VEC4, 5120, 1, byte, true), (Floats{-1, -1, 0, 1}));
  const auto ubyte = pack<std::uint8_t>({0, 51, 255, 1});
  EXPECT_EQ(read_one(TINYGLTF_TYPE_VEC2, 5121, 2, ubyte, false), (Floats{0, 51, 255, 1}));
  EXPECT_EQ(read_one(TINYGLTF_TYPE_VEC2, 5121, 2, ubyte, true),
            (Floats{0, 51 / 255.0f, 1, 1 / 255.0f}));
  const auto int16 = pack<std::int16_t>({-32768, -32767, 32767});
  EXPECT_EQ(read_one(TINYGLTF_TYPE_VEC3, 5122, 1, int16, false), (Floats{-32768, -32767, 32767}));
  EXPECT_EQ(read_one(TINYGLTF_TYPE_VEC3, 5122, 1, int16, true), (Floats{-1, -1, 1}));
  const auto uint16 = pack<std::uint16_t>({0, 65535, 13107});
  EXPECT_EQ(read_one(TINYGLTF_TYPE_SCALAR, 5123, 3, uint16, true), (Floats{0, 1, 0.2f}));
  const auto uint32 = pack<std::uint32_t>({7, 16777216});
  EXPECT_EQ(read_one(TINYGLTF_TYPE_SCALAR, 5125, 2, uint32, false), (Floats{7, 16777216}));
  const auto real = pack<float>({1.5f, -0.0f});
  EXPECT_EQ(read_one(TINYGLTF_TYPE_SCALAR, 5126, 2, real, false), (Floats{1.5f, -0.0f}));
}

TEST(Accessor, UnsignedIntegers) {
  Builder builder;
  const int bytes = builder.add_view(pack<std::uint8_t>({1, 2, 255}), 0, 0);
  const int shorts = builder.add_view(pack<std::uint16_t>({9, 65535}), 0, 0);
  const int ints = builder.add_view(pack<std::uint32_t>({9, 4294967295u}), 0, 0);
  const auto& read = builder.document;
  EXPECT_EQ(read.read_uints(builder.add(TINYGLTF_TYPE_SCALAR, 5121, 3, bytes)),
            (std::vector<std::uint32_t>{1, 2, 255}));
  EXPECT_EQ(read.read_uints(builder.add(TINYGLTF_TYPE_SCALAR, 5123, 2, shorts)),
            (std::vector<std::uint32_t>{9, 65535}));
  EXPECT_EQ(read.read_uints(builder.add(TINYGLTF_TYPE_SCALAR, 5125, 2, ints)),
            (std::vector<std::uint32_t>{9, 4294967295u}));
}

TEST(Accessor, InterleavedWithOffsets) {
  Builder builder;
  // Two vertices of {float x, y, z; ubyte r, g, b, pad}, behind four bytes.
  std::vector<std::uint8_t> bytes(4);
  for (int i = 0; i < 2; ++i) {
    const auto position = pack<float>({i + 0.5f, i + 1.5f, i + 2.5f});
    bytes.insert(bytes.end(), position.begin(), position.end());
    const auto byte = static_cast<std::uint8_t>(i);
    bytes.insert(bytes.end(), {byte, static_cast<std::uint8_t>(byte + 10), 200, 99});
  }
  const int view = builder.add_view(bytes, 4, 16);
  EXPECT_EQ(builder.document.read_floats(builder.add(TINYGLTF_TYPE_VEC3, 5126, 2, view)),
            (Floats{0.5f, 1.5f, 2.5f, 1.5f, 2.5f, 3.5f}));
  EXPECT_EQ(builder.document.read_floats(builder.add(TINYGLTF_TYPE_VEC3, 5121, 2, view, false, 12)),
            (Floats{0, 10, 200, 1, 11, 200}));
}

// glTF 2.0, 3.6.2.4: each column starts at a multiple of four bytes.
TEST(Accessor, PaddedMatrixColumns) {
  const auto bytes = pack<std::int8_t>({1, 2, 3, 99, 4, 5, 6, 99, 7, 8, 9, 99});
  EXPECT_EQ(read_one(TINYGLTF_TYPE_MAT3, 5120, 1, bytes, false),
            (Floats{1, 2, 3, 4, 5, 6, 7, 8, 9}));
  const auto small = pack<std::uint8_t>({1, 2, 99, 99, 3, 4, 99, 99, 5, 6, 99, 99, 7, 8, 99, 99});
  EXPECT_EQ(read_one(TINYGLTF_TYPE_MAT2, 5121, 2, small, false), (Floats{1, 2, 3, 4, 5, 6, 7, 8}));
  const auto shorts = pack<std::int16_t>({1, 2, 3, 99, 4, 5, 6, 99, 7, 8, 9, 99});
  EXPECT_EQ(read_one(TINYGLTF_TYPE_MAT3, 5122, 1, shorts, false),
            (Floats{1, 2, 3, 4, 5, 6, 7, 8, 9}));
  EXPECT_EQ(element_layout(TINYGLTF_TYPE_MAT2, 5121).bytes, 8u);
  EXPECT_EQ(element_layout(TINYGLTF_TYPE_MAT3, 5122).bytes, 24u);
  EXPECT_EQ(element_layout(TINYGLTF_TYPE_MAT4, 5126).bytes, 64u);
}

TEST(Accessor, SparseOverZerosAndOverAView) {
  Builder builder;
  const int indices = builder.add_view(pack<std::uint8_t>({1, 3}), 0, 0);
  const int values = builder.add_view(pack<float>({5, 6, 7, 8}), 0, 0);
  const int base =
      builder.add_view(pack<float>({1, 1, 0, 2, 2, 0, 3, 3, 0, 4, 4, 0}), 0, 12);  // strided
  for (const int view : {-1, base}) {
    const int accessor = builder.add(TINYGLTF_TYPE_VEC2, 5126, 4, view);
    auto& sparse = builder.document.model.accessors.back().sparse;
    sparse.isSparse = true;
    sparse.count = 2;
    sparse.indices.bufferView = indices;
    sparse.indices.byteOffset = 0;
    sparse.indices.componentType = TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE;
    sparse.values.bufferView = values;
    sparse.values.byteOffset = 0;
    const Floats expected =
        view < 0 ? Floats{0, 0, 5, 6, 0, 0, 7, 8} : Floats{1, 1, 5, 6, 3, 3, 7, 8};
    EXPECT_EQ(builder.document.read_floats(accessor), expected);
  }
}

TEST(Accessor, LooksThroughSparseValues) {
  Builder builder;
  const int indices = builder.add_view(pack<std::uint8_t>({2}), 0, 0);
  const int values = builder.add_view(pack<std::uint16_t>({40}), 0, 0);
  const int accessor = builder.add(TINYGLTF_TYPE_SCALAR, 5123, 2000000000, -1);
  auto& sparse = builder.document.model.accessors.back().sparse;
  sparse.isSparse = true;
  sparse.count = 1;
  sparse.indices.bufferView = indices;
  sparse.indices.byteOffset = 0;
  sparse.indices.componentType = TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE;
  sparse.values.bufferView = values;
  sparse.values.byteOffset = 0;
  EXPECT_EQ(largest_uint(builder.document.model, accessor), 40u);
}

}  // namespace
}  // namespace octrace::gltf
