// KHR_draco_mesh_compression, encoded by libdraco itself.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
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

TEST(Draco, SequentialKeepsEveryBit) {
  for (const char* name : {"default", "paper", "soup:300"}) {
    SCOPED_TRACE(name);
    Parts parts = parts_of_builtin(name);
    const scene::Scene plain = flattened(parts);
    ASSERT_GT(draco_encode(parts, DracoMethod::sequential), 0);
    expect_same_arrays(flattened(parts), plain);
  }
}

// Vertices and triangles come in another order; the picture is the same.
TEST(Draco, EdgebreakerKeepsThePicture) {
  for (const char* name : {"default", "paper"}) {
    SCOPED_TRACE(name);
    Parts parts = parts_of_builtin(name);
    const scene::Scene plain = flattened(parts);
    ASSERT_GT(draco_encode(parts, DracoMethod::edgebreaker), 0);
    const scene::Scene decoded = flattened(parts);
    EXPECT_EQ(decoded.triangles.size(), plain.triangles.size());
    const Difference found = compare_pictures(plain, decoded, 1e-5);
    EXPECT_GT(found.covered, found.pixels / 16);
    EXPECT_EQ(found.masks + found.objects + found.materials + found.depths, 0);
  }
}

// Skins, morph targets beside compressed attributes, colours, several sets.
TEST(Draco, SharedScenesKeepEveryBit) {
  const std::filesystem::path folder = std::filesystem::path(OCTRACE_SHARED_SCENES) / "valid";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is missing";
  int files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const std::string path = entry.path().string();
    if (!path.ends_with(".gltf") && !path.ends_with(".glb")) continue;
    SCOPED_TRACE(path);
    Parts parts = parts_of_file(path);
    const scene::Scene plain = flattened(parts);
    if (draco_encode(parts, DracoMethod::sequential) == 0) continue;
    ++files;
    expect_same_arrays(flattened(parts), plain);
  }
  EXPECT_GT(files, 10);
}

// The base scene's one triangle, its skin and its texture coordinates.
Parts small(DracoMethod method = DracoMethod::sequential, DracoValues values = DracoValues::exact) {
  Parts parts;
  parts.root = base_scene();
  parts.bin = base_buffer();
  parts.root["buffers"][0].erase("uri");
  if (method == DracoMethod::edgebreaker) {
    parts.root["meshes"][0]["primitives"][0].erase("targets");
    parts.root["meshes"][0].erase("weights");
    parts.root["nodes"][3].erase("weights");
  }
  EXPECT_EQ(draco_encode(parts, method, values), 1);
  return parts;
}

json& primitive(Parts& parts) { return parts.root["meshes"][0]["primitives"][0]; }
json& extension(Parts& parts) {
  return primitive(parts)["extensions"]["KHR_draco_mesh_compression"];
}
json& accessor(Parts& parts, const char* attribute) {
  return parts.root["accessors"][primitive(parts)["attributes"][attribute].get<std::size_t>()];
}
std::size_t stream_begin(Parts& parts) {
  return parts.root["bufferViews"][extension(parts)["bufferView"].get<std::size_t>()]["byteOffset"]
      .get<std::size_t>();
}

// Where the file holds both, the compressed form is what is read, and the accessors' own views
// stay for whoever else uses them.
TEST(Draco, ReplacesTheAccessorsViewsForItsPrimitiveOnly) {
  Parts parts = small();
  parts.root["extensionsRequired"] = json::array({"KHR_texture_transform"});
  json plain_primitive = base_scene()["meshes"][0]["primitives"][0];
  // The compressed primitive's POSITION gets a fallback of zeros, which a second mesh shows.
  Bytes zeros(36, 0);
  const int view = parts.append_view(zeros);
  accessor(parts, "POSITION")["bufferView"] = view;
  plain_primitive["attributes"]["POSITION"] = primitive(parts)["attributes"]["POSITION"];
  parts.root["meshes"].push_back({{"primitives", json::array({plain_primitive})}});
  const auto document = gltf::load_bytes(parts.glb(), "both.glb", {});
  ASSERT_TRUE(document) << document.error().to_string();
  const auto positions = [&](std::size_t mesh) {
    return document->read_floats(
        document->model.meshes[mesh].primitives[0].attributes.at("POSITION"));
  };
  EXPECT_EQ(positions(0), (std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}));
  EXPECT_EQ(positions(1), std::vector<float>(9, 0.0f));
}

// Two primitives of one stream.
TEST(Draco, OneStreamForTwoPrimitives) {
  Parts parts = small();
  json second = primitive(parts);
  second["material"] = 1;
  parts.root["meshes"][0]["primitives"].push_back(second);
  const auto document = gltf::load_bytes(parts.glb(), "two.glb", {});
  ASSERT_TRUE(document) << document.error().to_string();
  const auto& primitives = document->model.meshes[0].primitives;
  EXPECT_EQ(primitives[0].attributes, primitives[1].attributes);
  EXPECT_EQ(primitives[0].indices, primitives[1].indices);
  EXPECT_EQ(document->read_uints(primitives[1].indices), (std::vector<std::uint32_t>{0, 1, 2}));
}

struct Broken {
  const char* name;
  std::function<void(Parts&)> change;
  const char* code;
  std::string pointer;
  int exit = 3;
};

TEST(Draco, BrokenFilesAreRefused) {
  const std::string here = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
  const auto byte = [](std::size_t at, std::uint8_t value) {
    return [=](Parts& parts) { parts.bin[stream_begin(parts) + at] = value; };
  };
  const auto length = [](std::uint64_t bytes) {
    return [=](Parts& parts) {
      parts.root["bufferViews"][extension(parts)["bufferView"].get<std::size_t>()]["byteLength"] =
          bytes;
    };
  };
  // Every accessor of the primitive, since all must agree, but the morph target's.
  const auto count = [](std::uint64_t elements) {
    return [=](Parts& parts) {
      primitive(parts).erase("targets");
      parts.root["meshes"][0].erase("weights");
      parts.root["nodes"][3].erase("weights");
      for (const auto& [name, index] : primitive(parts)["attributes"].items()) {
        accessor(parts, name.c_str())["count"] = elements;
      }
    };
  };
  const std::vector<Broken> cases = {
      {"no view", [](Parts& p) { extension(p).erase("bufferView"); }, "UNDEFINED_PROPERTY", here},
      {"view beyond", [](Parts& p) { extension(p)["bufferView"] = 99; }, "UNRESOLVED_REFERENCE",
       here + "/bufferView"},
      {"no attributes", [](Parts& p) { extension(p).erase("attributes"); }, "UNDEFINED_PROPERTY",
       here},
      {"empty attributes", [](Parts& p) { extension(p)["attributes"] = json::object(); },
       "EMPTY_ENTITY", here + "/attributes"},
      {"attribute of its own", [](Parts& p) { extension(p)["attributes"]["COLOR_0"] = 7; },
       "UNSATISFIED_DEPENDENCY", here + "/attributes/COLOR_0"},
      {"negative id", [](Parts& p) { extension(p)["attributes"]["NORMAL"] = -1; },
       "VALUE_NOT_IN_RANGE", here + "/attributes/NORMAL"},
      {"unknown id", [](Parts& p) { extension(p)["attributes"]["NORMAL"] = 4; },
       "DRACO_DATA_INVALID", here + "/attributes/NORMAL"},
      {"id of another shape",
       [](Parts& p) {
         extension(p)["attributes"]["NORMAL"] = extension(p)["attributes"]["WEIGHTS_0"];
       },
       "DRACO_DATA_INVALID", here + "/attributes/NORMAL"},
      {"points", [](Parts& p) { primitive(p)["mode"] = 0; }, "DRACO_INVALID_MODE",
       "/meshes/0/primitives/0/mode"},
      {"strip", [](Parts& p) { primitive(p)["mode"] = 5; }, "DRACO_INVALID_MODE",
       "/meshes/0/primitives/0/mode", 4},
      {"no indices", [](Parts& p) { primitive(p).erase("indices"); }, "UNSATISFIED_DEPENDENCY",
       here},
      {"more vertices", count(4), "DRACO_DATA_INVALID", here + "/attributes/JOINTS_0"},
      {"fewer vertices", count(2), "DRACO_DATA_INVALID", here},
      {"more indices",
       [](Parts& p) {
         p.root["accessors"][primitive(p)["indices"].get<std::size_t>()]["count"] = 6;
       },
       "DRACO_DATA_INVALID", here},
      {"fewer indices",
       [](Parts& p) {
         p.root["accessors"][primitive(p)["indices"].get<std::size_t>()]["count"] = 2;
       },
       "DRACO_DATA_INVALID", here},
      {"wrong magic", byte(0, 'd'), "DRACO_DATA_INVALID", here},
      {"version 1.3",
       [&](Parts& p) {
         byte(5, 1)(p);
         byte(6, 3)(p);
       },
       "DRACO_VERSION", here, 4},
      {"version 9", byte(5, 9), "DRACO_VERSION", here, 4},
      {"point cloud", byte(7, 0), "DRACO_DATA_INVALID", here},
      {"unknown method", byte(8, 9), "DRACO_DATA_INVALID", here},
      {"metadata", byte(10, 0x80), "DRACO_DATA_INVALID", here},
      {"empty", length(1), "DRACO_DATA_INVALID", here},
      {"header alone", length(11), "DRACO_DATA_INVALID", here},
      {"half", length(60), "DRACO_DATA_INVALID", here},
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

// A stream whose head claims billions of faces, and accessors that agree: refused by the stream's
// size before libdraco takes memory by it.
TEST(Draco, BombIsRefused) {
  for (const DracoMethod method : {DracoMethod::sequential, DracoMethod::edgebreaker}) {
    Parts parts = small(method);
    const std::size_t begin = stream_begin(parts);
    const auto at = parts.bin.begin() + static_cast<std::ptrdiff_t>(begin);
    Bytes stream(at, parts.bin.end());
    // Varints of 300,000,000 for the two one-byte counts behind the header (of 11 bytes) and, under
    // edgebreaker, the kind of its traversal.
    const Bytes huge = {0x80, 0xc6, 0x86, 0x8f, 0x01};
    const auto counts = stream.begin() + (method == DracoMethod::edgebreaker ? 12 : 11);
    ASSERT_EQ(counts[0], method == DracoMethod::edgebreaker ? 3 : 1);
    ASSERT_EQ(counts[1], method == DracoMethod::edgebreaker ? 1 : 3);
    Bytes bomb(stream.begin(), counts);
    for (int n = 0; n < 2; ++n) bomb.insert(bomb.end(), huge.begin(), huge.end());
    bomb.insert(bomb.end(), counts + 2, stream.end());
    extension(parts)["bufferView"] = parts.append_view(bomb);
    const std::uint64_t faces = 300000000;
    primitive(parts).erase("targets");
    parts.root["meshes"][0].erase("weights");
    parts.root["nodes"][3].erase("weights");
    for (const auto& [name, index] : primitive(parts)["attributes"].items()) {
      accessor(parts, name.c_str())["count"] = faces;
    }
    parts.root["accessors"][primitive(parts)["indices"].get<std::size_t>()]["count"] = 3 * faces;
    const auto document = gltf::load_bytes(parts.glb(), "bomb.glb", {});
    ASSERT_FALSE(document);
    EXPECT_EQ(document.error().code, "DRACO_DATA_INVALID") << document.error().to_string();
    EXPECT_NE(document.error().message.find("cannot hold"), std::string::npos)
        << document.error().message;
  }
}

// A number within the attributes' data by which libdraco takes time and memory: 2^31 - 1 of them
// are refused wherever in the stream the number is, without being counted to.
TEST(Draco, OrientationsAreBoundedByTheMesh) {
  const Parts valid = small(DracoMethod::edgebreaker, DracoValues::quantised);
  ASSERT_TRUE(gltf::load_bytes(valid.glb(), "valid.glb", {}));
  int refused = 0;
  Parts parts = valid;
  for (std::size_t at = stream_begin(parts) + 11; at + 4 <= valid.bin.size(); ++at) {
    parts.bin = valid.bin;
    constexpr std::array<std::uint8_t, 4> kMost{0xff, 0xff, 0xff, 0x7f};
    std::copy(kMost.begin(), kMost.end(), parts.bin.begin() + static_cast<std::ptrdiff_t>(at));
    const auto document = gltf::load_bytes(parts.glb(), "patched.glb", {});
    if (document) continue;
    EXPECT_NE(document.error().exit, util::Exit::internal) << document.error().to_string();
    const bool counted = document.error().message.find("orientations") != std::string::npos;
    if (counted) {
      EXPECT_EQ(document.error().code, "DRACO_DATA_INVALID");
    }
    refused += counted;
  }
  EXPECT_GT(refused, 0) << "no number of orientations was found";
}

// Primitives may share accessors, so that the limit counts what is decoded and not the accessors.
TEST(Draco, RespectsMaxSceneBytes) {
  Parts parts = small();
  const json first = primitive(parts);
  for (int i = 0; i < 20; ++i) {
    json another = first;
    parts.root["bufferViews"].push_back(
        parts.root["bufferViews"][first["extensions"]["KHR_draco_mesh_compression"]["bufferView"]
                                      .get<std::size_t>()]);
    another["extensions"]["KHR_draco_mesh_compression"]["bufferView"] =
        parts.root["bufferViews"].size() - 1;
    parts.root["meshes"][0]["primitives"].push_back(another);
  }
  gltf::LoadOptions options;
  options.limits.max_scene_bytes = 2500;
  EXPECT_TRUE(gltf::load_bytes(small().glb(), "one.glb", options));
  const auto document = gltf::load_bytes(parts.glb(), "many.glb", options);
  ASSERT_FALSE(document);
  EXPECT_EQ(document.error().code, "LIMIT") << document.error().to_string();
  EXPECT_EQ(document.error().exit, util::Exit::limit);
}

// Any damage to a stream is an error, or decodes to something that keeps every promise.
TEST(Draco, DamagedStreamsDoNoHarm) {
  std::mt19937_64 random(seed());
  for (const DracoMethod method : {DracoMethod::sequential, DracoMethod::edgebreaker}) {
    Parts valid = small(method);
    const std::size_t begin = stream_begin(valid);
    for (std::uint64_t i = 0; i < scaled(1500); ++i) {
      Parts parts = valid;
      for (int n = 0; n < 3; ++n) {
        parts.bin[begin + random() % (parts.bin.size() - begin)] =
            static_cast<std::uint8_t>(random());
      }
      const auto document = gltf::load_bytes(parts.glb(), "damaged.glb", {});
      if (!document) {
        ASSERT_NE(document.error().exit, util::Exit::internal)
            << "seed " << seed() << ": " << document.error().to_string();
        continue;
      }
      const auto& shown = document->model.meshes[0].primitives[0];
      for (const std::uint32_t index : document->read_uints(shown.indices)) ASSERT_LT(index, 3u);
    }
  }
}

}  // namespace
}  // namespace octrace::tests
