// Writes the fuzzer's first inputs into a folder: the base scene in its forms, compressed and not,
// and each patch of it.
#include <fstream>
#include <string>

#include "tests/compression/encode.h"
#include "tests/malformed/base_scene.h"
#include "tests/malformed/patch_cases.h"

namespace {

// Edgebreaker reorders vertices, and morph targets are no part of what Draco holds.
void json_without_morphs(nlohmann::json& root) {
  root["meshes"][0].erase("weights");
  root["meshes"][0]["primitives"][0].erase("targets");
  root["nodes"][3].erase("weights");
}

}  // namespace

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
  const auto write_parts = [&](const std::string& name, const Parts& parts) {
    const Bytes bytes = parts.glb();
    write(name, std::string(bytes.begin(), bytes.end()));
  };
  const Parts plain{binary, base_buffer()};
  Parts meshopt = plain, sequential = plain, edgebreaker = plain;
  meshopt_encode(meshopt, {});
  write_parts("meshopt.glb", meshopt);
  draco_encode(sequential, DracoMethod::sequential);
  write_parts("draco_sequential.glb", sequential);
  json_without_morphs(edgebreaker.root);
  draco_encode(edgebreaker, DracoMethod::edgebreaker);
  write_parts("draco_edgebreaker.glb", edgebreaker);
  for (const auto& broken : patch_cases()) {
    write(broken.name + ".gltf", base.patch(nlohmann::json::parse(broken.patch)).dump());
  }
  return 0;
}
