#include "tests/support/instanced_features.h"

#include <cmath>
#include <random>

#include "tests/support/instanced_scene.h"

namespace octrace::tests {

namespace {

using scene::testing::base64;
using scene::testing::GltfFile;
using scene::testing::json;

// Part of a lopsided barrel about y, smooth, its corners apart at the seam of its texture.
json barrel_part(GltfFile& file, double from, double to, int rings, bool tangents, bool colors) {
  constexpr int kAround = 14;
  std::vector<float> positions, normals, tangent, uvs, rgba;
  for (int ring = 0; ring <= rings; ++ring) {
    for (int i = 0; i <= kAround; ++i) {
      const double y = from + (to - from) * ring / rings, turn = 2 * M_PI * i / kAround;
      const double r = 0.5 + 0.3 * std::cos(y) + 0.1 * std::sin(2 * turn);
      const double slope = 0.3 * std::sin(y), bend = 0.2 * std::cos(2 * turn);
      const glm::dvec3 out(std::cos(turn), 0, std::sin(turn)), on(-out.z, 0, out.x);
      const glm::dvec3 n = glm::normalize(r * out - bend * on + r * slope * glm::dvec3(0, 1, 0));
      const glm::dvec3 along = glm::normalize(bend * out + r * on);
      for (const double x : {r * out.x, y, r * out.z}) positions.push_back(static_cast<float>(x));
      for (int k = 0; k < 3; ++k) normals.push_back(static_cast<float>(n[k]));
      for (int k = 0; k < 3; ++k) tangent.push_back(static_cast<float>(along[k]));
      tangent.push_back(ring < rings / 2 ? -1.0f : 1.0f);
      uvs.push_back(3.0f * static_cast<float>(i) / kAround);
      uvs.push_back(static_cast<float>(y));
      for (const double x : {0.5 + 0.5 * out.x, 0.5, 0.5 + 0.5 * out.z, 0.3 + 0.1 * ring}) {
        rgba.push_back(static_cast<float>(x));
      }
    }
  }
  std::vector<std::uint16_t> indices;
  for (int ring = 0; ring < rings; ++ring) {
    for (int i = 0; i < kAround; ++i) {
      const int a = ring * (kAround + 1) + i, c = a + kAround + 1;
      for (const int corner : {a, c, a + 1, a + 1, c, c + 1}) {
        indices.push_back(static_cast<std::uint16_t>(corner));
      }
    }
  }
  json primitive = {{"attributes",
                     {{"POSITION", file.floats("VEC3", positions)},
                      {"NORMAL", file.floats("VEC3", normals)},
                      {"TEXCOORD_0", file.floats("VEC2", uvs)}}},
                    {"indices", file.uint16s("SCALAR", indices)}};
  if (tangents) primitive["attributes"]["TANGENT"] = file.floats("VEC4", tangent);
  if (colors) primitive["attributes"]["COLOR_0"] = file.floats("VEC4", rgba);
  return primitive;
}

// Blades: long, thin, crossing each other, flat shaded, with texture coordinates.
json blades(GltfFile& file) {
  std::vector<float> positions, uvs;
  std::mt19937 random(5);
  std::uniform_real_distribution<float> some(-1.0f, 1.0f);
  const auto point = [&] { return glm::vec3(some(random), some(random), some(random)); };
  for (int i = 0; i < 400; ++i) {
    const glm::vec3 a = point(), b = a + 0.03f * point(), c = point();
    for (const glm::vec3& corner : {a, b, c}) {
      for (int k = 0; k < 3; ++k) positions.push_back(corner[k]);
    }
    uvs.insert(uvs.end(), {0, 0, 0.2f, 0, 0.1f, 2});
  }
  return {
      {"attributes",
       {{"POSITION", file.floats("VEC3", positions)}, {"TEXCOORD_0", file.floats("VEC2", uvs)}}}};
}

// A PNG of 8 by 8 whose pixels are a tag, for pattern_images() to tell.
std::string png(char tag) {
  std::string bytes = "\x89PNG\r\n\x1a\n";
  const auto chunk = [&](const std::string& type, const std::string& data) {
    bytes += std::string(3, '\0') + static_cast<char>(data.size()) + type + data;
    bytes += std::string(4, '\0');  // a checksum is the real decoder's business
  };
  chunk("IHDR", std::string("\0\0\0\x08\0\0\0\x08\x08\x06\0\0\0", 13));
  chunk("IDAT", std::string(1, tag));
  chunk("IEND", "");
  return bytes;
}

void add_materials(GltfFile& file) {
  for (const char tag : {'0', '1'}) {
    file.append("images", {{"uri", "data:image/png;base64," + base64(png(tag))}});
    file.append("textures", {{"source", file.root["images"].size() - 1}});
  }
  const json bumps = {{"index", 1}, {"scale", 0.7}};
  file.append("materials", {{"name", "cut, one side"},
                            {"alphaMode", "MASK"},
                            {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}},
                            {"normalTexture", bumps}});
  file.append("materials", {{"name", "clear, both sides"},
                            {"alphaMode", "BLEND"},
                            {"doubleSided", true},
                            {"pbrMetallicRoughness", {{"baseColorFactor", {0.9, 0.8, 0.7, 0.9}}}}});
  file.append("materials", {{"name", "bumps, one side"}, {"normalTexture", bumps}});
  file.append("materials", {{"name", "cut, both sides"},
                            {"alphaMode", "MASK"},
                            {"alphaCutoff", 0.4},
                            {"doubleSided", true},
                            {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
}

class PairMaker {
 public:
  explicit PairMaker(GltfFile plain) : pair_{plain, std::move(plain)} {}
  int node(const json& node) {
    pair_.nodes.append("nodes", node);
    return pair_.instances.append("nodes", node);
  }
  // `count` instances of a mesh: without rotations and scales where `moved_only`.
  int instances(json node, int mesh, int count, std::uint64_t seed, bool moved_only) {
    std::mt19937_64 random(seed);
    const auto some = [&](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(random);
    };
    std::vector<float> t, r, s;
    const int index = static_cast<int>(pair_.instances.root["nodes"].size());
    for (int i = 0; i < count; ++i) {
      json shown = {{"mesh", mesh}};
      const auto add = [&](const char* path, std::vector<float>& all, std::vector<double> values) {
        shown[path] = json::array();
        for (const double x : values) {
          all.push_back(static_cast<float>(x));
          shown[path].push_back(double{all.back()});
        }
      };
      add("translation", t, {some(-4, 4), some(-4, 4), some(-4, 4)});
      if (!moved_only) {
        const glm::dvec4 q =
            glm::normalize(glm::dvec4(some(-1, 1), some(-1, 1), some(-1, 1), some(-1, 1)));
        add("rotation", r, {q.x, q.y, q.z, q.w});
        const auto scale = [&] { return some(0.3, 1.5) * (some(0, 1) < 0.5 ? -1 : 1); };
        add("scale", s, {scale(), scale(), scale()});
      }
      children_.push_back({index, shown});
    }
    pair_.nodes.append("nodes", node);
    json attributes = {{"TRANSLATION", pair_.instances.floats("VEC3", t)}};
    if (!moved_only) {
      attributes["ROTATION"] = pair_.instances.floats("VEC4", r);
      attributes["SCALE"] = pair_.instances.floats("VEC3", s);
    }
    node["mesh"] = mesh;
    node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = attributes;
    return pair_.instances.append("nodes", node);
  }
  InstancedPair finish(const json& roots) {
    pair_.instances.root["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
    for (GltfFile* file : {&pair_.instances, &pair_.nodes}) {
      file->append("scenes", {{"nodes", roots}});
    }
    for (const auto& [parent, shown] : children_) {
      const int child = pair_.nodes.append("nodes", shown);
      pair_.nodes.root["nodes"][parent]["children"].push_back(child);
    }
    return std::move(pair_);
  }

 private:
  InstancedPair pair_;
  std::vector<std::pair<int, json>> children_;
};

}  // namespace

InstancedPair instanced_features() {
  GltfFile file;
  add_materials(file);
  json lower = barrel_part(file, -1.0, 0.3, 5, true, false);
  json upper = barrel_part(file, 0.3, 1.2, 3, false, true);
  json plain = barrel_part(file, -1.0, 1.0, 6, false, false);
  json fan = blades(file);
  lower["material"] = 0;
  upper["material"] = 1;
  plain["material"] = 2;
  fan["material"] = 3;
  const int barrel =
      file.append("meshes", {{"name", "barrel"}, {"primitives", json::array({lower, upper})}});
  const int bumps = file.append("meshes", {{"primitives", json::array({plain})}});
  const int fans = file.append("meshes", {{"primitives", json::array({fan})}});
  const int floor = file.mesh({-7, -6, -7, -7, -6, 7, 7, -6, 7, -7, -6, -7, 7, -6, 7, 7, -6, -7});

  PairMaker make(std::move(file));
  make.node({{"name", "shear"},
             {"matrix", {1, 0, 0, 0, 0.5, 1, 0, 0, -0.2, 0.3, 0.8, 0, 0.5, 0, 0, 1}},
             {"children", {1, 3}}});
  make.instances({{"name", "barrels"}, {"scale", {1, 1.4, 1}}}, barrel, 12, 1, false);
  make.node({{"mesh", barrel}, {"translation", {0, 2, 3}}});
  make.instances({{"name", "bumps"}}, bumps, 12, 2, false);
  make.instances({{"name", "moved"}, {"rotation", {0.6, 0, 0, 0.8}}}, barrel, 5, 3, true);
  make.node({{"mesh", floor}});
  make.instances({{"name", "fans"}}, fans, 6, 4, false);
  return make.finish({0, 2, 4, 5, 6});
}

scene::FlattenOptions pattern_images() {
  scene::FlattenOptions options;
  options.decode = [](std::span<const std::uint8_t> bytes, const std::string&,
                      const util::Limits&) -> util::Result<scene::DecodedImage> {
    scene::DecodedImage image{8, 8, {}};
    const bool colors = bytes[41] == '0';
    for (std::uint32_t y = 0; y < 8; ++y) {
      for (std::uint32_t x = 0; x < 8; ++x) {
        // Bytes from the lowest: red, green, blue, alpha. The second image leans normals about.
        const std::uint32_t clear = (x / 2 + y / 2) % 2, lean = 90 + 12 * x, other = 100 + 9 * y;
        image.texels.push_back(colors ? (clear != 0 ? 0x00206040u : 0xff80c0ffu) + (x << 4)
                                      : 0xffe00000u | other << 8 | lean);
      }
    }
    return image;
  };
  return options;
}

}  // namespace octrace::tests
