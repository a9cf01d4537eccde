// The Khronos validator finds no error in what the other tests here read, so that they test glTF
// and not a dialect of their own. It knows Draco's and meshopt's files but not what their streams
// hold.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

#include "tests/compression/encode.h"

namespace octrace::tests {
namespace {

namespace fs = std::filesystem;

// The folder of script/setup --validation, or the one that the exporters' tests fill.
std::string node_folder() {
  std::istringstream folders(OCTRACE_NODE_FOLDERS);
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (fs::exists(fs::path(folder) / "node_modules" / "gltf-validator")) return folder;
  }
  return "";
}

constexpr const char* kScript = R"js(
const validator = require(process.argv[2] + '/node_modules/gltf-validator'), fs = require('fs');
(async () => {
  let errors = 0;
  for (const file of process.argv.slice(3)) {
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)));
    for (const m of report.issues.messages) {
      if (m.severity === 0) console.log(file, m.code, m.pointer, m.message);
    }
    errors += report.issues.numErrors;
  }
  process.exit(errors === 0 ? 0 : 1);
})();
)js";

TEST(CompressionValidator, FindsNoErrorInTheTestsFiles) {
  const std::string node = node_folder();
  if (node.empty() || std::system("node --version > /dev/null 2>&1") != 0) {
    GTEST_SKIP() << "node or its package gltf-validator is not there (script/setup --validation)";
  }
  const fs::path folder = fs::path(testing::TempDir()) / "octrace_compression_validator";
  fs::create_directories(folder);
  std::ofstream(folder / "validate.js") << kScript;
  std::string command = "node '" + (folder / "validate.js").string() + "' '" + node + "'";
  const auto add = [&](const std::string& name, const Parts& parts) {
    const std::string path = (folder / (name + ".glb")).string();
    const Bytes bytes = parts.glb();
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
    command += " '" + path + "'";
  };
  Parts meshopt = parts_of_builtin("default");
  meshopt_encode(meshopt, {});
  add("meshopt", meshopt);
  for (const DracoMethod method : {DracoMethod::sequential, DracoMethod::edgebreaker}) {
    Parts draco = parts_of_builtin("default");
    draco_encode(draco, method);
    add(method == DracoMethod::sequential ? "sequential" : "edgebreaker", draco);
  }
  for (const auto& entry : fs::directory_iterator(OCTRACE_TEST_DATA "/compressed")) {
    if (entry.path().extension() == ".glb") command += " '" + entry.path().string() + "'";
  }
  const std::string log = (folder / "log").string();
  const int code = std::system((command + " > '" + log + "' 2>&1").c_str());
  std::ifstream stream(log);
  EXPECT_EQ(code, 0) << std::string(std::istreambuf_iterator<char>(stream), {});
  fs::remove_all(folder);
}

}  // namespace
}  // namespace octrace::tests
