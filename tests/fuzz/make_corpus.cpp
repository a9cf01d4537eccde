// Writes the fuzzer's first inputs into a folder: the base scene in its forms, and each patch of
// it.
#include <fstream>
#include <string>

#include "tests/malformed/base_scene.h"
#include "tests/malformed/patch_cases.h"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const std::string folder = argv[1];
  const auto write = [&](const std::string& name, const std::string& text) {
    std::ofstream(folder + "/" + name, std::ios::binary) << text;
  };
  using namespace octrace::tests;
  const auto base = base_scene();
  write("base.gltf", base.dump());
  auto binary = base;
  binary["buffers"][0].erase("uri");
  const auto glb = make_glb(binary.dump(), base_buffer());
  write("base.glb", std::string(glb.begin(), glb.end()));
  for (const auto& broken : patch_cases()) {
    write(broken.name + ".gltf", base.patch(nlohmann::json::parse(broken.patch)).dump());
  }
  return 0;
}
