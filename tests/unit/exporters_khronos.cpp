#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "backend/scene/builtin.h"
#include "exporters/gltf/gltf.h"
#include "exporters/text.h"
#include "tests/unit/exporters_programs.h"
#include "tests/unit/exporters_scene.h"

namespace octrace::test {
namespace {

constexpr const char* kPackage = "gltf-validator@2.0.0-dev.3.10";

// A folder of the build's that holds node_modules/gltf-validator; empty: there is none to be had.
std::string validator_folder() {
  const std::filesystem::path folder = std::filesystem::path(OCTRACE_TEST_CACHE) / "gltf-validator";
  if (std::filesystem::exists(folder / "node_modules" / "gltf-validator")) return folder.string();
  if (!installed("node") || !installed("npm")) return "";
  std::filesystem::create_directories(folder);
  const int code = run_in(folder.string(), "npm",
                          {"install", "--no-audit", "--no-fund", "--fetch-retries=1",
                           "--fetch-timeout=20000", "--prefix", ".", kPackage});
  return code == 0 ? folder.string() : "";
}

constexpr const char* kScript = R"js(
const validator = require('gltf-validator'), fs = require('fs');
(async () => {
  let errors = 0;
  for (const file of process.argv.slice(2)) {
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)));
    for (const m of report.issues.messages) {
      if (m.severity === 0) console.log(file, m.code, m.pointer, m.message);
    }
    errors += report.issues.numErrors;
    console.log(file, report.issues.numErrors, 'errors');
  }
  process.exit(errors === 0 ? 0 : 1);
})();
)js";

TEST(KhronosValidator, FindsNoErrorInWhatIsExported) {
  const std::string folder = validator_folder();
  if (folder.empty()) GTEST_SKIP() << "node, npm or the package gltf-validator is not to be had";
  std::ofstream(folder + "/validate.js") << kScript;

  const TemporaryFolder out;
  std::vector<std::string> arguments{"validate.js"};
  const auto add = [&](const std::string& name, const scene::Scene& scene) {
    const std::string path = out.file(name + ".glb");
    const auto file = exporters::write_gltf(scene, path);
    ASSERT_TRUE(file) << file.error().to_string();
    arguments.push_back(path);
  };
  for (const char* name : {"default", "paper", "terrain:20", "soup:50"}) {
    const auto scene = scene::make_builtin(name);
    ASSERT_TRUE(scene) << scene.error().to_string();
    add(exporters::identifier(name), *scene);
  }
  scene::Scene varied = varied_scene();
  varied.object_names[0] = "\xff\xfe not UTF-8";
  varied.lights = {
      {kernels::LightType::spot, {1, 2, 3}, {0, -1, 0}, {9, 9, 9}, 4.0f, 1000.0f, -999.0f},
      {kernels::LightType::directional, {}, {0, 0, 1}, {0, 0, 0}, INFINITY, 0, 0}};
  varied.cameras.push_back(look_at({3, 2, 5}, {0, 0, 0}, 0.7));
  varied.cameras.push_back(varied.cameras.back());
  varied.cameras.back().type = scene::CameraType::orthographic;
  varied.materials[0].emissive = {7.0f, 0.1f, 0.0f};
  add("varied", varied);
  scene::Scene odd;
  add_material(odd, {});
  Part part = card("card", {0, 0, 0}, 1, 1);
  part.normals = {{0, 0, 0}, {0, 0, 5}, {NAN, 0, 1}, {0, 1, 0}};
  part.uvs[2] = {INFINITY, NAN};
  part.colors = {{2, -1, 0.5f, 1}, {1, 1, 1, 1}, {1, 1, 1, 1}, {NAN, 1, 1, 1}};
  add_part(odd, part);
  finish(odd);
  add("odd", odd);
  add("empty", {});

  const int code = run_in(folder, "node", arguments);
  EXPECT_EQ(code, 0) << read_text(folder + "/node.log");
}

}  // namespace
}  // namespace octrace::test
