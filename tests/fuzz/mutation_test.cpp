// Seeded random damage to valid files: each is refused, or keeps every promise of a loaded
// document.
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "tests/fuzz/document_promises.h"
#include "tests/malformed/base_scene.h"
#include "tests/support/intensity.h"

namespace octrace::tests {
namespace {

using nlohmann::json;
using Random = std::mt19937_64;
using Bytes = std::vector<std::uint8_t>;

std::size_t below(Random& random, std::size_t end) { return end == 0 ? 0 : random() % end; }

void damage_bytes(Bytes& bytes, Random& random) {
  for (std::size_t n = 1 + below(random, 4); n > 0 && !bytes.empty(); --n) {
    const std::size_t at = below(random, bytes.size());
    const std::size_t length = 1 + below(random, std::min<std::size_t>(16, bytes.size() - at));
    const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(at);
    const auto end = begin + static_cast<std::ptrdiff_t>(length);
    switch (below(random, 6)) {
      case 0:
        bytes[at] = static_cast<std::uint8_t>(random());
        break;
      case 1:
        bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ 1u << below(random, 8));
        break;
      case 2:
        bytes.erase(begin, end);
        break;
      case 3: {
        const Bytes copy(begin, end);
        bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(below(random, bytes.size())),
                     copy.begin(), copy.end());
        break;
      }
      case 4:
        bytes.resize(at);
        break;
      default:
        std::fill(begin, end, static_cast<std::uint8_t>(below(random, 2) * 0xff));
        break;
    }
  }
}

json interesting_value(Random& random) {
  static const json values = json::parse(R"([
    -1, 0, 1, 2, 3, 4, 7, 12, 255, 256, 352, 5120, 5121, 5123, 5125, 5126, 65535, 2147483647,
    2147483648, 4294967295, 4294967296, 9007199254740992, 9223372036854775807,
    18446744073709551615, -9223372036854775808, 0.5, 1.0, -0.0, 1e-300, 1e38, 1e300, "", "x",
    "SCALAR", "VEC2", "VEC4", "MAT2", "MAT4", "CUBICSPLINE", "STEP", "weights", "rotation", "BLEND",
    "data:,", "data:;base64,AAAA", "../x", null, true, false, [], {}, [0], [0, 1], [[]], {"0": {}}
  ])");
  return values[below(random, values.size())];
}

// A random place of the tree, never the root.
json::json_pointer random_place(const json& root, Random& random) {
  const json flat = root.flatten();
  std::vector<std::string> places;
  for (const auto& [pointer, value] : flat.items()) places.push_back(pointer);
  json::json_pointer place(places[below(random, places.size())]);
  for (std::size_t up = below(random, 3); up > 0 && !place.parent_pointer().empty(); --up) {
    place = place.parent_pointer();
  }
  return place;
}

void damage_json(json& root, Random& random) {
  for (std::size_t n = 1 + below(random, 3); n > 0 && !root.empty(); --n) {
    const auto place = random_place(root, random);
    json& parent = root.at(place.parent_pointer());
    switch (below(random, 4)) {
      case 0:
        if (parent.is_array()) {
          parent.erase(below(random, parent.size()));
        } else {
          parent.erase(place.back());
        }
        break;
      case 1:
        root.at(place) = json(root.at(random_place(root, random)));
        break;
      case 2:
        if (parent.is_array()) parent.push_back(json(parent[below(random, parent.size())]));
        [[fallthrough]];
      default:
        root.at(place) = interesting_value(random);
        break;
    }
  }
}

std::string show(const Bytes& bytes) { return std::string(bytes.begin(), bytes.end()); }

void expect_promises(const Bytes& bytes, const std::string& name) {
  EXPECT_EQ(broken_promise(bytes, name), "") << "seed " << seed() << "\n" << show(bytes);
}

Bytes bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

Bytes base_glb() {
  json scene = base_scene();
  scene["buffers"][0].erase("uri");
  return make_glb(scene.dump(), base_buffer());
}

TEST(Mutation, Bytes) {
  Random random(seed());
  const Bytes glb = base_glb(), text = bytes_of(base_scene().dump());
  for (std::uint64_t i = 0; i < scaled(4000) && !HasFailure(); ++i) {
    Bytes bytes = i % 2 == 0 ? glb : text;
    damage_bytes(bytes, random);
    expect_promises(bytes, i % 2 == 0 ? "bytes.glb" : "bytes.gltf");
  }
}

// Damage to the buffer alone passes the structure's checks and reaches those of the data.
TEST(Mutation, BinaryChunk) {
  Random random(seed() + 1);
  const Bytes glb = base_glb();
  const std::size_t begin = glb.size() - base_buffer().size();
  for (std::uint64_t i = 0; i < scaled(2000) && !HasFailure(); ++i) {
    Bytes bytes = glb;
    for (std::size_t n = 1 + below(random, 3); n > 0; --n) {
      bytes[begin + below(random, bytes.size() - begin)] = static_cast<std::uint8_t>(random());
    }
    expect_promises(bytes, "chunk.glb");
  }
}

TEST(Mutation, Json) {
  Random random(seed() + 2);
  const json base = base_scene();
  for (std::uint64_t i = 0; i < scaled(4000) && !HasFailure(); ++i) {
    json scene = base;
    damage_json(scene, random);
    expect_promises(bytes_of(scene.dump()), "json.gltf");
  }
}

// The promises themselves must be able to fail, and the base scene must reach them.
TEST(Mutation, BaseSceneIsAccepted) {
  EXPECT_EQ(broken_promise(base_glb(), "base.glb"), "");
  EXPECT_EQ(broken_promise(bytes_of("{}"), "empty.gltf"), "");
}

}  // namespace
}  // namespace octrace::tests
