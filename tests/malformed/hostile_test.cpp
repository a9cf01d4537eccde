// Inputs made to do harm: outside the scene's folder, never ending, nested, or larger than memory.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "backend/gltf/document.h"
#include "tests/malformed/base_scene.h"

namespace octrace::tests {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using util::Exit;

std::vector<std::uint8_t> bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

util::Error error_of(const util::Result<gltf::Document>& document) {
  return document ? util::Error{Exit::ok, "accepted", "", "", ""} : document.error();
}

util::Error load_text(const std::string& text, const util::Limits& limits = {}) {
  return error_of(gltf::load_bytes(bytes_of(text), "hostile.gltf", {limits, false}));
}

#define EXPECT_ERROR(error, wanted_exit, wanted_code, wanted_pointer) \
  do {                                                                \
    const util::Error found = (error);                                \
    EXPECT_EQ(found.exit, wanted_exit) << found.to_string();          \
    EXPECT_EQ(found.code, wanted_code) << found.to_string();          \
    EXPECT_EQ(found.pointer, wanted_pointer) << found.to_string();    \
  } while (false)

// A folder of its own with a "scene" folder in it, and a secret beside that.
class Hostile : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (fs::temp_directory_path() / "octrace_hostile_XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    root_ = pattern;
    fs::create_directories(root_ / "scene" / "sub");
    write("secret.bin", base_buffer());
    write("scene/inside.bin", base_buffer());
    write("scene/sub/deep er.bin", base_buffer());
    fs::create_directories(root_ / "scene-twin");
    write("scene-twin/twin.bin", base_buffer());
  }
  void TearDown() override { fs::remove_all(root_); }

  void write(const std::string& name, const std::vector<std::uint8_t>& bytes) {
    std::ofstream(root_ / name, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  }
  std::string path(const std::string& name) const { return (root_ / name).string(); }

  util::Result<gltf::Document> load_with_uri(const std::string& uri,
                                             const gltf::LoadOptions& options = {}) {
    json scene = base_scene();
    scene["buffers"][0]["uri"] = uri;
    write("scene/scene.gltf", bytes_of(scene.dump()));
    return gltf::load(path("scene/scene.gltf"), options);
  }
  util::Result<gltf::Document> load_with_image(const std::string& uri, bool warn) {
    json scene = base_scene();
    scene["images"][0]["uri"] = uri;
    write("scene/scene.gltf", bytes_of(scene.dump()));
    gltf::LoadOptions options;
    options.missing_images_warn = warn;
    return gltf::load(path("scene/scene.gltf"), options);
  }

  fs::path root_;
};

TEST_F(Hostile, ReadsFilesOfItsOwnFolder) {
  for (const char* uri : {"inside.bin", "./inside.bin", "sub/../inside.bin", "sub/deep%20er.bin",
                          "sub/deep er.bin", "sub//deep%20er.bin", "%69nside.bin"}) {
    const auto document = load_with_uri(uri);
    EXPECT_TRUE(document) << uri << ": " << document.error().to_string();
  }
}

TEST_F(Hostile, NeverLeavesTheFolder) {
  for (const char* uri : {"../secret.bin", "sub/../../secret.bin", "%2e%2e/secret.bin",
                          "..%2fsecret.bin", "%2E%2E%2Fsecret.bin", "./../secret.bin", "..",
                          "sub/..", ".", "../scene-twin/twin.bin", "../scene/inside.bin"}) {
    EXPECT_ERROR(error_of(load_with_uri(uri)), Exit::invalid_input, "INVALID_URI",
                 "/buffers/0/uri");
  }
}

TEST_F(Hostile, RefusesOtherSchemesAndAbsolutePaths) {
  const std::string absolute = path("scene/inside.bin");
  for (const std::string& uri :
       {absolute, "file://" + absolute, "file:" + absolute, "%2f" + absolute,
        std::string("FILE:inside.bin"), std::string("http://127.0.0.1/x.bin"),
        std::string("//127.0.0.1/x.bin"), std::string("c:/x.bin")}) {
    EXPECT_ERROR(error_of(load_with_uri(uri)), Exit::invalid_input, "NON_RELATIVE_URI",
                 "/buffers/0/uri");
  }
}

TEST_F(Hostile, ExpandsNothing) {
  ::setenv("OCTRACE_TEST_FILE", "inside.bin", 1);
  for (const char* uri : {"$OCTRACE_TEST_FILE", "${OCTRACE_TEST_FILE}", "~/inside.bin", "*.bin",
                          "insid?.bin", "$(touch pwned)", "`touch pwned`", "|cat inside.bin"}) {
    EXPECT_ERROR(error_of(load_with_uri(uri)), Exit::io, "IO_ERROR", "/buffers/0/uri");
  }
  EXPECT_FALSE(fs::exists(root_ / "scene" / "pwned"));
}

TEST_F(Hostile, RefusesBrokenUris) {
  for (const std::string& uri :
       {std::string("a%00.bin"), std::string("a%.bin"), std::string("a%4"), std::string("a%zz"),
        std::string("a\n.bin"), std::string("a\0.bin", 6), std::string("data:"),
        std::string("data:;base64"), std::string("data:application/octet-stream;base64,AAA"),
        std::string("data:application/octet-stream;base64,A==="),
        std::string("data:application/octet-stream;base64,AA=A"),
        std::string("data:application/octet-stream;base64,AA AA"),
        std::string("data:application/octet-stream;base64,\xc3\xa9\xc3\xa9"),
        std::string("data:application;base64,AAAA"), std::string("data:a/b;c;base64,AAAA"),
        std::string("data:a/b,%4")}) {
    EXPECT_ERROR(error_of(load_with_uri(uri)), Exit::invalid_input, "INVALID_URI",
                 "/buffers/0/uri");
  }
}

TEST_F(Hostile, FollowsLinksOnlyWithinTheFolder) {
  fs::create_symlink("inside.bin", root_ / "scene/near.bin");
  fs::create_symlink(path("scene/inside.bin"), root_ / "scene/near_absolute.bin");
  fs::create_symlink("../secret.bin", root_ / "scene/far.bin");
  fs::create_symlink(path("secret.bin"), root_ / "scene/far_absolute.bin");
  fs::create_directory_symlink("..", root_ / "scene/up");
  fs::create_symlink("loop.bin", root_ / "scene/loop.bin");
  fs::create_symlink("/dev/zero", root_ / "scene/zero.bin");
  EXPECT_TRUE(load_with_uri("near.bin"));
  EXPECT_TRUE(load_with_uri("near_absolute.bin"));
  for (const char* uri : {"far.bin", "far_absolute.bin", "up/secret.bin", "zero.bin"}) {
    EXPECT_ERROR(error_of(load_with_uri(uri)), Exit::invalid_input, "INVALID_URI",
                 "/buffers/0/uri");
  }
  EXPECT_ERROR(error_of(load_with_uri("loop.bin")), Exit::io, "IO_ERROR", "/buffers/0/uri");
}

// The user may name the scene itself through a link: its folder is then the link's.
TEST_F(Hostile, ReadsASceneBehindALinkedFolder) {
  ASSERT_TRUE(load_with_uri("inside.bin"));
  fs::create_directory_symlink("scene", root_ / "alias");
  EXPECT_TRUE(gltf::load(path("alias/scene.gltf"), {}));
}

TEST_F(Hostile, ReadsRegularFilesOnly) {
  ASSERT_EQ(::mkfifo(path("scene/pipe.bin").c_str(), 0600), 0);
  for (const char* uri : {"pipe.bin", "sub", "missing.bin", "inside.bin/x"}) {
    EXPECT_ERROR(error_of(load_with_uri(uri)), Exit::io, "IO_ERROR", "/buffers/0/uri");
  }
  for (const auto& file : {path("scene/pipe.bin"), path("scene"), path("none.gltf"), path(""),
                           std::string("/dev/null"), std::string()}) {
    const util::Error error = error_of(gltf::load(file, {}));
    EXPECT_ERROR(error, Exit::io, "IO_ERROR", "");
    EXPECT_EQ(error.file, file);
  }
}

TEST_F(Hostile, MissingImagesAreErrorsUnlessAllowed) {
  EXPECT_ERROR(error_of(load_with_image("none.png", false)), Exit::io, "IO_ERROR", "/images/0/uri");
  const auto missing = load_with_image("none.png", true);
  ASSERT_TRUE(missing) << missing.error().to_string();
  ASSERT_EQ(missing->images.size(), 1u);
  EXPECT_TRUE(missing->images[0].bytes.empty());
  EXPECT_EQ(missing->warnings.size(), 1u);
  const auto broken = load_with_image("inside.bin", true);
  ASSERT_TRUE(broken) << broken.error().to_string();
  EXPECT_TRUE(broken->images[0].bytes.empty());
  EXPECT_EQ(broken->warnings.size(), 1u);
  EXPECT_ERROR(error_of(load_with_image("../secret.bin", true)), Exit::invalid_input, "INVALID_URI",
               "/images/0/uri");
}

TEST_F(Hostile, LimitsAreNamed) {
  gltf::LoadOptions options;
  options.limits.max_file_bytes = base_buffer().size() - 1;
  json scene = base_scene();
  scene["buffers"][0]["uri"] = "inside.bin";
  write("scene/scene.gltf", bytes_of(scene.dump()));
  const util::Error whole = error_of(gltf::load(path("scene/scene.gltf"), options));
  EXPECT_ERROR(whole, Exit::limit, "LIMIT", "");
  EXPECT_NE(whole.message.find("--max-file-bytes"), std::string::npos);

  // A hole of a terabyte: the limit must speak before memory is taken.
  ASSERT_EQ(::truncate(path("scene/inside.bin").c_str(), off_t{1} << 40), 0);
  const util::Error part = error_of(gltf::load(path("scene/scene.gltf"), {}));
  EXPECT_ERROR(part, Exit::limit, "LIMIT", "/buffers/0/uri");
  EXPECT_NE(part.message.find("--max-file-bytes"), std::string::npos);

  const auto limited = [](auto member, std::uint64_t value) {
    util::Limits limits;
    limits.*member = value;
    return load_text(base_scene().dump(), limits);
  };
  const struct {
    std::uint64_t util::Limits::*member;
    const char* option;
    std::uint64_t value;
  } rows[] = {{&util::Limits::max_json_bytes, "--max-json-bytes", 100},
              {&util::Limits::max_json_depth, "--max-json-depth", 4},
              {&util::Limits::max_scene_bytes, "--max-scene-bytes", 300},
              {&util::Limits::max_nodes, "--max-nodes", 3},
              {&util::Limits::max_texture_pixels, "--max-texture-pixels", 0}};
  for (const auto& row : rows) {
    const util::Error error = limited(row.member, row.value);
    EXPECT_EQ(error.exit, Exit::limit) << row.option << ": " << error.to_string();
    EXPECT_NE(error.message.find(row.option), std::string::npos) << error.to_string();
  }
}

std::string repeated(const std::string& text, std::size_t count) {
  std::string out;
  for (std::size_t i = 0; i < count; ++i) out += text;
  return out;
}

TEST(HostileJson, DeepNesting) {
  const std::string head = R"({"asset": {"version": "2.0", "extras": )";
  for (const std::size_t depth : {200, 100000, 5000000}) {
    EXPECT_ERROR(load_text(head + repeated("[", depth) + repeated("]", depth) + "}}"), Exit::limit,
                 "LIMIT", "");
    EXPECT_ERROR(load_text(repeated("{\"a\":", depth)), Exit::limit, "LIMIT", "");
    EXPECT_ERROR(load_text(repeated("[", depth)), Exit::limit, "LIMIT", "");
  }
  // However high the option, the stack must bear it.
  util::Limits limits;
  limits.max_json_depth = 1ull << 40;
  EXPECT_ERROR(load_text(head + repeated("[", 2000000) + repeated("]", 2000000) + "}}", limits),
               Exit::limit, "LIMIT", "");
  const std::string extras = repeated("[", 1000) + repeated("]", 1000);
  EXPECT_EQ(load_text(head + extras + "}}", limits).exit, Exit::ok);
}

// Brackets inside strings are no nesting, whatever backslashes stand around them.
TEST(HostileJson, BracketsInStrings) {
  const std::string text =
      R"({"asset": {"version": "2.0", "generator": "\\\"[)" + repeated("[", 1000) + R"(\\"}})";
  EXPECT_EQ(load_text(text).exit, Exit::ok) << load_text(text).to_string();
}

TEST(HostileJson, BrokenText) {
  for (const std::string& text :
       {std::string(), std::string(" \n"), std::string("nul"), std::string("[]"), std::string("3"),
        std::string("\"{\""), std::string("{\"asset\": "),
        std::string(R"({"asset": {"version": "2.0"}} x)"),
        std::string(R"({"asset": {"version": "2.0"}, "scene": 1e400})"),
        std::string(R"({"asset": {"version": "2.0"}, "scene": NaN})"),
        std::string("{\"asset\": {\"version\": \"2.0\", \"generator\": \"\xff\xfe\"}}"),
        std::string("{\"asset\": {\"version\": \"2.0\", \"generator\": \"\xed\xa0\x80\"}}"),
        std::string(R"({"asset": {"version": "2.0", "generator": "\ud800"}})"),
        std::string("{\"asset\": {\"version\": \"2.0\"}}\0", 30)}) {
    EXPECT_ERROR(load_text(text), Exit::invalid_input, "INVALID_JSON", "");
  }
}

// Integers may be written as 3.0, and tinygltf must then see the same number.
TEST(HostileJson, WholeNumbersWithAFraction) {
  json scene = base_scene();
  scene["accessors"][0]["count"] = 3.0;
  scene["nodes"][3]["mesh"] = 0.0;
  scene["bufferViews"][1]["byteOffset"] = 36.0;
  const auto document = gltf::load_bytes(bytes_of(scene.dump()), "base.gltf", {});
  ASSERT_TRUE(document) << document.error().to_string();
  EXPECT_EQ(document->model.accessors[0].count, 3u);
  EXPECT_EQ(document->model.nodes[3].mesh, 0);
  EXPECT_EQ(document->model.bufferViews[1].byteOffset, 36u);
}

TEST(HostileJson, UnknownExtensionsAreOneWarningEach) {
  json scene = base_scene();
  scene["extensionsUsed"].push_back("EXT_no_such_thing");
  scene["extensionsUsed"].push_back("KHR_materials_ior");
  const auto document = gltf::load_bytes(bytes_of(scene.dump()), "base.gltf", {});
  ASSERT_TRUE(document) << document.error().to_string();
  ASSERT_EQ(document->warnings.size(), 2u);
  EXPECT_NE(document->warnings[0].find("EXT_no_such_thing"), std::string::npos);
}

// A path from the root in a graph of shared children doubles with each level; glTF forbids sharing.
TEST(HostileJson, NodeGraphs) {
  json scene = {{"asset", {{"version", "2.0"}}}, {"nodes", json::array()}};
  for (int i = 0; i < 64; ++i) scene["nodes"].push_back({{"children", {i + 1, i + 65}}});
  for (int i = 0; i < 66; ++i) scene["nodes"].push_back(json::object());
  EXPECT_EQ(load_text(scene.dump()).exit, Exit::ok) << load_text(scene.dump()).to_string();
  scene["nodes"][65] = {{"children", {66}}};
  EXPECT_ERROR(load_text(scene.dump()), Exit::invalid_input, "NODE_PARENT_OVERRIDE",
               "/nodes/65/children/0");
}

TEST(HostileJson, LongChainsAndLoops) {
  const int length = 200000;
  json scene = {{"asset", {{"version", "2.0"}}}, {"nodes", json::array()}};
  for (int i = 0; i + 1 < length; ++i) scene["nodes"].push_back({{"children", {i + 1}}});
  scene["nodes"].push_back(json::object());
  EXPECT_EQ(load_text(scene.dump()).exit, Exit::ok);
  scene["nodes"].back() = {{"children", {0}}};
  EXPECT_ERROR(load_text(scene.dump()), Exit::invalid_input, "NODE_LOOP", "/nodes/0");
}

// Many accessors over one view: the work is bounded, not only each one's size.
TEST(HostileJson, ManyAccessorsOverOneView) {
  json scene = base_scene();
  for (int i = 0; i < 1000; ++i) scene["accessors"].push_back(scene["accessors"][0]);
  util::Limits limits;
  limits.max_scene_bytes = 10000;
  const util::Error error = load_text(scene.dump(), limits);
  EXPECT_EQ(error.exit, Exit::limit) << error.to_string();
  EXPECT_NE(error.message.find("--max-scene-bytes"), std::string::npos);
}

TEST(HostileGlb, EveryTruncationIsAnError) {
  json scene = base_scene();
  scene["buffers"][0].erase("uri");
  const auto glb = make_glb(scene.dump(), base_buffer());
  ASSERT_TRUE(gltf::load_bytes(glb, "whole.glb", {}));
  for (std::size_t size = 0; size < glb.size();
       size += size < 40 || size + 40 > glb.size() ? 1 : 97) {
    const std::vector<std::uint8_t> part(glb.begin(),
                                         glb.begin() + static_cast<std::ptrdiff_t>(size));
    const util::Error error = error_of(gltf::load_bytes(part, "part.glb", {}));
    EXPECT_EQ(error.exit, Exit::invalid_input) << size << ": " << error.to_string();
    EXPECT_TRUE(error.code.starts_with("GLB_")) << size << ": " << error.to_string();
  }
}

TEST(HostileGlb, Headers) {
  const auto with = [](std::size_t offset, std::uint32_t value) {
    auto glb = make_glb(R"({"asset": {"version": "2.0"}})", std::vector<std::uint8_t>(4));
    for (int i = 0; i < 4; ++i) glb[offset + i] = static_cast<std::uint8_t>(value >> 8 * i);
    return error_of(gltf::load_bytes(glb, "header.glb", {})).code;
  };
  EXPECT_EQ(with(0, 0x46546c68), "GLB_INVALID_MAGIC");
  EXPECT_EQ(with(4, 1), "GLB_INVALID_VERSION");
  EXPECT_EQ(with(8, 0), "GLB_LENGTH_TOO_SMALL");
  EXPECT_EQ(with(8, 0xffffffff), "GLB_LENGTH_MISMATCH");
  EXPECT_EQ(with(12, 0xfffffffc), "GLB_CHUNK_TOO_BIG");
  EXPECT_EQ(with(12, 0xffffffff), "GLB_CHUNK_LENGTH_UNALIGNED");
  EXPECT_EQ(with(12, 0), "GLB_EMPTY_CHUNK");
  EXPECT_EQ(with(16, 0x004e4942), "GLB_UNEXPECTED_FIRST_CHUNK");
  EXPECT_EQ(with(56, 0x4e4f534a), "GLB_DUPLICATE_CHUNK");
  EXPECT_EQ(with(56, 0x12345678), "accepted");  // unknown chunks are for extensions
}

}  // namespace
}  // namespace octrace::tests
