// EXT_meshopt_compression, encoded by meshoptimizer itself.
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <random>

#include "tests/compression/encode.h"
#include "tests/compression/same.h"
#include "tests/malformed/base_scene.h"
#include "tests/support/intensity.h"

namespace octrace::tests {
namespace {

using nlohmann::json;

TEST(Meshopt, BuiltinScenesKeepEveryBit) {
  for (const char* name : {"default", "paper", "soup:300"}) {
    SCOPED_TRACE(name);
    Parts parts = parts_of_builtin(name);
    const scene::Scene plain = flattened(parts);
    const std::size_t size = parts.bin.size();
    ASSERT_GT(meshopt_encode(parts, {.triangles = false}), 1);
    EXPECT_LT(parts.bin.size(), size);
    expect_same_arrays(flattened(parts), plain);
  }
}

// The codec may begin a triangle at another of its corners, but neither turns it over nor moves it.
TEST(Meshopt, TrianglesKeepTheirOrderAndPicture) {
  Parts parts = parts_of_builtin("default");
  const scene::Scene plain = flattened(parts);
  ASSERT_GT(meshopt_encode(parts, {.triangles = true}), 1);
  const scene::Scene decoded = flattened(parts);
  EXPECT_TRUE(same_bits(decoded.positions, plain.positions));
  ASSERT_EQ(decoded.triangles.size(), plain.triangles.size());
  for (std::size_t t = 0; t < plain.triangles.size(); ++t) {
    const auto [a, b, c] = plain.triangles[t];
    const auto& d = decoded.triangles[t];
    const bool turned = (d.a == a && d.b == b && d.c == c) || (d.a == b && d.b == c && d.c == a) ||
                        (d.a == c && d.b == a && d.c == b);
    ASSERT_TRUE(turned) << "triangle " << t;
  }
  const Difference found = compare_pictures(plain, decoded, 1e-5);
  EXPECT_GT(found.covered, found.pixels / 4);
  EXPECT_EQ(found.masks + found.objects + found.materials + found.depths, 0);
}

// Skins, morph targets, animations, sparse accessors, interleaved views.
TEST(Meshopt, SharedScenesKeepEveryBit) {
  const std::filesystem::path folder = std::filesystem::path(OCTRACE_SHARED_SCENES) / "valid";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is missing";
  int files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const std::string path = entry.path().string();
    if (!path.ends_with(".gltf") && !path.ends_with(".glb")) continue;
    SCOPED_TRACE(path);
    Parts parts = parts_of_file(path);
    const scene::Scene plain = flattened(parts);
    if (meshopt_encode(parts, {.triangles = false}) == 0) continue;
    ++files;
    expect_same_arrays(flattened(parts), plain);
  }
  EXPECT_GT(files, 10);
}

// One accessor of 4 components over one compressed view.
Parts filtered(const Bytes& decoded, std::size_t count, std::size_t stride, int component,
               const char* filter) {
  Parts parts;
  parts.root = base_scene();
  Bytes bytes(meshopt_encodeVertexBufferBound(count, stride));
  bytes.resize(
      meshopt_encodeVertexBuffer(bytes.data(), bytes.size(), decoded.data(), count, stride));
  parts.root["buffers"] = json::array(
      {{{"byteLength", bytes.size()}}, {{"byteLength", 352}}, {{"byteLength", 1 << 20}}});
  parts.root["buffers"][1]["uri"] = data_uri(base_buffer());
  for (json& view : parts.root["bufferViews"]) view["buffer"] = 1;
  parts.root["bufferViews"].push_back({{"buffer", 2},
                                       {"byteLength", count * stride},
                                       {"extensions",
                                        {{"EXT_meshopt_compression",
                                          {{"buffer", 0},
                                           {"byteLength", bytes.size()},
                                           {"byteStride", stride},
                                           {"count", count},
                                           {"mode", "ATTRIBUTES"},
                                           {"filter", filter}}}}}});
  json accessor = {
      {"bufferView", 11}, {"componentType", component}, {"count", count}, {"type", "VEC4"}};
  if (component != 5126) accessor["normalized"] = true;
  parts.root["accessors"].push_back(accessor);
  use_extension(parts.root, "EXT_meshopt_compression");
  parts.bin = std::move(bytes);
  return parts;
}

std::vector<float> random_units(std::size_t count, std::uint64_t from) {
  std::mt19937_64 random(from);
  std::normal_distribution<float> normal;
  std::vector<float> values;
  for (std::size_t i = 0; i < count; ++i) {
    float v[4], length = 0.0f;
    for (float& x : v) {
      x = normal(random);
      length += x * x;
    }
    for (const float x : v) values.push_back(x / std::sqrt(length));
  }
  return values;
}

std::vector<float> decoded_values(const Parts& parts) {
  const auto document = gltf::load_bytes(parts.glb(), "filtered.glb", {});
  if (!document) {
    ADD_FAILURE() << document.error().to_string();
    return {};
  }
  return document->read_floats(10);
}

TEST(Meshopt, OctahedralFilter) {
  constexpr std::size_t kCount = 333;  // no multiple of what SIMD takes at once
  auto units = random_units(kCount, seed());
  for (std::size_t i = 0; i < kCount; ++i) {  // directions in x y z, a sign in w
    float* v = &units[4 * i];
    const float length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int c = 0; c < 3; ++c) v[c] /= length;
    v[3] = v[3] < 0.0f ? -1.0f : 1.0f;
  }
  for (const int bytes : {1, 2}) {
    const std::size_t stride = 4 * static_cast<std::size_t>(bytes);
    Bytes data(kCount * stride);
    meshopt_encodeFilterOct(data.data(), kCount, stride, 8 * bytes, units.data());
    const auto values =
        decoded_values(filtered(data, kCount, stride, bytes == 1 ? 5120 : 5122, "OCTAHEDRAL"));
    ASSERT_EQ(values.size(), units.size());
    const float bound = bytes == 1 ? 0.025f : 1e-4f;
    for (std::size_t i = 0; i < values.size(); ++i) {
      ASSERT_NEAR(values[i], units[i], bound) << "seed " << seed() << ", value " << i;
    }
  }
}

TEST(Meshopt, QuaternionFilter) {
  constexpr std::size_t kCount = 129;
  const auto units = random_units(kCount, seed() + 1);
  Bytes data(kCount * 8);
  meshopt_encodeFilterQuat(data.data(), kCount, 8, 12, units.data());
  const auto values = decoded_values(filtered(data, kCount, 8, 5122, "QUATERNION"));
  ASSERT_EQ(values.size(), units.size());
  for (std::size_t i = 0; i < kCount; ++i) {  // q and -q are the same rotation
    float dot = 0.0f;
    for (int c = 0; c < 4; ++c) dot += values[4 * i + c] * units[4 * i + c];
    ASSERT_NEAR(std::abs(dot), 1.0f, 5e-5f) << "seed " << seed() << ", quaternion " << i;
  }
}

TEST(Meshopt, ExponentialFilter) {
  constexpr std::size_t kCount = 77;
  auto numbers = random_units(kCount, seed() + 2);
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] *= std::ldexp(1.0f, i % 30);
  Bytes data(kCount * 16);
  meshopt_encodeFilterExp(data.data(), kCount, 16, 23, numbers.data());
  const auto values = decoded_values(filtered(data, kCount, 16, 5126, "EXPONENTIAL"));
  ASSERT_EQ(values.size(), numbers.size());
  for (std::size_t i = 0; i < kCount; ++i) {  // the four of an element share an exponent
    float largest = 0.0f;
    for (int c = 0; c < 4; ++c) largest = std::max(largest, std::abs(numbers[4 * i + c]));
    for (int c = 0; c < 4; ++c) {
      ASSERT_NEAR(values[4 * i + c], numbers[4 * i + c], std::ldexp(largest, -20))
          << "seed " << seed();
    }
  }
}

// What compressed views replace is never read: here it lies in a file that does not exist.
TEST(Meshopt, FallbackIsNotRead) {
  Parts parts = parts_of_builtin("paper");
  const scene::Scene plain = flattened(parts);
  meshopt_encode(parts, {.triangles = false});
  parts.root["buffers"][1]["uri"] = "no_such_file.bin";
  expect_same_arrays(flattened(parts), plain);
  // Also where no mark says that it is a fallback.
  parts.root["buffers"][1].erase("extensions");
  parts.root["extensionsRequired"] = json::array({"KHR_lights_punctual"});
  expect_same_arrays(flattened(parts), plain);
  // And its size takes nothing from the limit.
  parts.root["buffers"][1]["byteLength"] = std::int64_t{1} << 50;
  expect_same_arrays(flattened(parts), plain);
}

// A first view of attributes and a last view of indices.
Parts small() {
  Parts parts;
  parts.root = json::parse(R"({"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "accessors": [
      {"bufferView": 0, "componentType": 5126, "count": 300, "type": "VEC3",
       "min": [0, 0, 0], "max": [299, 1, 1]},
      {"bufferView": 1, "componentType": 5123, "count": 894, "type": "SCALAR"}],
    "bufferViews": [{"buffer": 0, "byteLength": 3600},
                    {"buffer": 0, "byteOffset": 3600, "byteLength": 1788}],
    "buffers": [{"byteLength": 5388}]})");
  const auto add = [&](const void* data, std::size_t size) {
    const auto* bytes = static_cast<const std::uint8_t*>(data);
    parts.bin.insert(parts.bin.end(), bytes, bytes + size);
  };
  for (int i = 0; i < 300; ++i) {
    const float v[3] = {static_cast<float>(i), static_cast<float>(i % 2), 0.5f};
    add(v, sizeof v);
  }
  for (std::uint16_t i = 0; i < 298; ++i) {
    const std::uint16_t corners[3] = {i, static_cast<std::uint16_t>(i + 1),
                                      static_cast<std::uint16_t>(i + 2)};
    add(corners, sizeof corners);
  }
  meshopt_encode(parts, {.triangles = true});
  return parts;
}

json& extension(Parts& parts, int view) {
  return parts
      .root["bufferViews"][static_cast<std::size_t>(view)]["extensions"]["EXT_meshopt_compression"];
}

struct Broken {
  const char* name;
  std::function<void(Parts&)> change;
  const char* code;
  std::string pointer;
  int exit = 3;
};

TEST(Meshopt, BrokenFilesAreRefused) {
  const std::string first = "/bufferViews/0/extensions/EXT_meshopt_compression";
  const std::string second = "/bufferViews/1/extensions/EXT_meshopt_compression";
  const auto set = [](int view, const char* key, json value) {
    return [=](Parts& parts) { extension(parts, view)[key] = value; };
  };
  const auto drop = [](const char* key) {
    return [=](Parts& parts) { extension(parts, 0).erase(key); };
  };
  // Both the count and the length, so that only the data can tell.
  const auto claim = [](int view, std::uint64_t count) {
    return [=](Parts& parts) {
      const auto stride = extension(parts, view)["byteStride"].get<std::uint64_t>();
      extension(parts, view)["count"] = count;
      parts.root["bufferViews"][static_cast<std::size_t>(view)]["byteLength"] = count * stride;
      parts.root["buffers"][1]["byteLength"] = 1ull << 42;
    };
  };
  const auto shorten = [](int view, int bytes) {
    return [=](Parts& parts) {
      auto& length = extension(parts, view)["byteLength"];
      length = length.get<int>() - bytes;
    };
  };
  const auto byte = [](int view, std::size_t at, std::uint8_t value) {
    return [=](Parts& parts) {
      parts.bin[extension(parts, view)["byteOffset"].get<std::size_t>() + at] = value;
    };
  };
  const std::vector<Broken> cases = {
      {"no buffer", drop("buffer"), "UNDEFINED_PROPERTY", first},
      {"no length", drop("byteLength"), "UNDEFINED_PROPERTY", first},
      {"no stride", drop("byteStride"), "UNDEFINED_PROPERTY", first},
      {"no count", drop("count"), "UNDEFINED_PROPERTY", first},
      {"no mode", drop("mode"), "UNDEFINED_PROPERTY", first},
      {"buffer beyond", set(0, "buffer", 2), "UNRESOLVED_REFERENCE", first + "/buffer"},
      {"fallback as source", set(0, "buffer", 1), "MESHOPT_FALLBACK_BUFFER", first + "/buffer"},
      {"length beyond", set(0, "byteLength", 1 << 20), "BUFFER_VIEW_TOO_LONG",
       first + "/byteLength"},
      {"offset beyond", set(0, "byteOffset", 9007199254740992), "BUFFER_VIEW_TOO_LONG",
       first + "/byteLength"},
      {"offset negative", set(0, "byteOffset", -1), "VALUE_NOT_IN_RANGE", first + "/byteOffset"},
      {"stride 0", set(0, "byteStride", 0), "VALUE_NOT_IN_RANGE", first + "/byteStride"},
      {"stride 260", set(0, "byteStride", 260), "VALUE_NOT_IN_RANGE", first + "/byteStride"},
      {"stride 6", set(0, "byteStride", 6), "MESHOPT_INVALID_BYTESTRIDE", first + "/byteStride"},
      {"index stride 3", set(1, "byteStride", 3), "MESHOPT_INVALID_BYTESTRIDE",
       second + "/byteStride"},
      {"octahedral stride", set(0, "filter", "OCTAHEDRAL"), "MESHOPT_INVALID_BYTESTRIDE",
       first + "/byteStride"},
      {"quaternion stride", set(0, "filter", "QUATERNION"), "MESHOPT_INVALID_BYTESTRIDE",
       first + "/byteStride"},
      {"filtered indices", set(1, "filter", "EXPONENTIAL"), "MESHOPT_INVALID_FILTER",
       second + "/filter"},
      {"unknown mode", set(0, "mode", "TETRAHEDRA"), "VALUE_NOT_IN_LIST", first + "/mode", 4},
      {"unknown filter", set(0, "filter", "COLOR"), "VALUE_NOT_IN_LIST", first + "/filter", 4},
      {"mode number", set(0, "mode", 1), "TYPE_MISMATCH", first + "/mode"},
      {"count 0", set(0, "count", 0), "VALUE_NOT_IN_RANGE", first + "/count"},
      {"count wrong", set(0, "count", 299), "MESHOPT_LENGTH_MISMATCH", "/bufferViews/0/byteLength"},
      {"triangles of 4", claim(1, 895), "VALUE_MULTIPLE_OF", second + "/count"},
      {"stride of the view", [](Parts& parts) { parts.root["bufferViews"][0]["byteStride"] = 16; },
       "MESHOPT_INVALID_BYTESTRIDE", "/bufferViews/0/byteStride"},
      {"plain view of a fallback",
       [](Parts& parts) { parts.root["bufferViews"][0].erase("extensions"); },
       "MESHOPT_FALLBACK_BUFFER", "/bufferViews/0/buffer"},
      {"more vertices", claim(0, 600), "MESHOPT_DATA_INVALID", first},
      {"more indices", claim(1, 897), "MESHOPT_DATA_INVALID", second},
      {"other mode", set(1, "mode", "INDICES"), "MESHOPT_DATA_INVALID", second},
      {"wrong header", byte(0, 0, 0xb0), "MESHOPT_DATA_INVALID", first},
      {"newer version", byte(0, 0, 0xa7), "MESHOPT_DATA_INVALID", first},
      {"index header", byte(1, 0, 0xa0), "MESHOPT_DATA_INVALID", second},
      {"truncated vertices", shorten(0, 1), "MESHOPT_DATA_INVALID", first},
      {"half the vertices", shorten(0, 60), "MESHOPT_DATA_INVALID", first},
      {"truncated indices", shorten(1, 17), "MESHOPT_DATA_INVALID", second},
      {"a byte", set(0, "byteLength", 1), "MESHOPT_DATA_INVALID", first},
      // Sizes that a few hundred bytes cannot decode to: refused before memory is taken.
      {"bomb of vertices", claim(0, 2147483646), "MESHOPT_DATA_INVALID", first},
      {"bomb of indices", claim(1, 2147483646), "MESHOPT_DATA_INVALID", second},
      {"bomb beyond the limit",
       [&](Parts& parts) {
         extension(parts, 0)["byteStride"] = 256;
         claim(0, 2147483646)(parts);
       },
       "LIMIT", "/bufferViews/0", 6},
  };
  for (const Broken& broken : cases) {
    SCOPED_TRACE(broken.name);
    Parts parts = small();
    broken.change(parts);
    const auto document = gltf::load_bytes(parts.glb(), "broken.glb", {});
    ASSERT_FALSE(document);
    EXPECT_EQ(document.error().code, broken.code) << document.error().to_string();
    EXPECT_EQ(document.error().pointer, broken.pointer) << document.error().to_string();
    EXPECT_EQ(static_cast<int>(document.error().exit), broken.exit);
  }
}

// Indices that decode to what no vertex has are found like any others.
TEST(Meshopt, DecodedIndicesAreChecked) {
  Parts parts = small();
  Parts fewer = small();
  fewer.root["accessors"][0]["count"] = 299;
  EXPECT_TRUE(gltf::load_bytes(parts.glb(), "small.glb", {}));
  const auto document = gltf::load_bytes(fewer.glb(), "fewer.glb", {});
  ASSERT_FALSE(document);
  EXPECT_EQ(document.error().code, "ACCESSOR_INDEX_OOB");
}

TEST(Meshopt, RespectsMaxSceneBytes) {
  gltf::LoadOptions options;
  options.limits.max_scene_bytes = 5387;  // a byte below what the two views decode to
  const auto document = gltf::load_bytes(small().glb(), "small.glb", options);
  ASSERT_FALSE(document);
  EXPECT_EQ(document.error().code, "LIMIT");
  EXPECT_EQ(document.error().exit, util::Exit::limit);
}

// Any damage to the streams is an error, or decodes to something that keeps every promise.
TEST(Meshopt, DamagedStreamsDoNoHarm) {
  const Parts valid = small();
  std::mt19937_64 random(seed());
  for (std::uint64_t i = 0; i < scaled(3000); ++i) {
    Parts parts = valid;
    for (int n = 0; n < 4; ++n)
      parts.bin[random() % parts.bin.size()] = static_cast<std::uint8_t>(random());
    const auto document = gltf::load_bytes(parts.glb(), "damaged.glb", {});
    if (!document) {
      ASSERT_NE(document.error().exit, util::Exit::internal) << "seed " << seed();
      continue;
    }
    for (const std::uint32_t index : document->read_uints(1)) ASSERT_LT(index, 300u);
  }
}

}  // namespace
}  // namespace octrace::tests
