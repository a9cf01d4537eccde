#include "tests/property/animated_scenes.h"

#include <cmath>

namespace octrace::tests {

namespace {

using nlohmann::json;
using scene::testing::GltfFile;

struct Shape {
  std::vector<float> positions, normals;
  std::vector<std::uint16_t> indices;
};

// A box of half extents h, its faces apart, with normals; `steps` rings along y.
Shape make_tube(float radius, float height, int around, int rings) {
  Shape shape;
  for (int ring = 0; ring <= rings; ++ring) {
    for (int i = 0; i < around; ++i) {
      const float angle = 6.2831853f * static_cast<float>(i) / static_cast<float>(around);
      const float x = std::cos(angle), z = std::sin(angle);
      shape.positions.insert(shape.positions.end(),
                             {radius * x, height * static_cast<float>(ring) / rings, radius * z});
      shape.normals.insert(shape.normals.end(), {x, 0.0f, z});
      if (ring == rings) continue;
      const int a = ring * around + i, b = ring * around + (i + 1) % around;
      const int c = a + around, d = b + around;
      for (const int index : {a, c, b, b, c, d}) {
        shape.indices.push_back(static_cast<std::uint16_t>(index));
      }
    }
  }
  return shape;
}

// One material, both sides, so that a tube shows its inside, too.
int add_shape(GltfFile& file, const Shape& shape, json more = json::object()) {
  if (!file.root.contains("materials")) file.append("materials", {{"doubleSided", true}});
  json primitive = {{"attributes",
                     {{"POSITION", file.floats("VEC3", shape.positions)},
                      {"NORMAL", file.floats("VEC3", shape.normals)}}},
                    {"indices", file.uint16s("SCALAR", shape.indices)},
                    {"material", 0}};
  primitive.merge_patch(more);
  return file.append("meshes", {{"primitives", json::array({primitive})}});
}

class AnimationMaker {
 public:
  explicit AnimationMaker(GltfFile& file) : file_(file) {}
  void add(int node, const char* path, const std::vector<float>& times,
           const std::vector<float>& values, const char* mode = "LINEAR") {
    const char* type = std::string(path) == "rotation"  ? "VEC4"
                       : std::string(path) == "weights" ? "SCALAR"
                                                        : "VEC3";
    add_output(node, path, times, file_.floats(type, values), mode);
  }
  void add_output(int node, const char* path, const std::vector<float>& times, int output,
                  const char* mode) {
    samplers_.push_back(
        {{"input", file_.floats("SCALAR", times)}, {"output", output}, {"interpolation", mode}});
    channels_.push_back(
        {{"sampler", samplers_.size() - 1}, {"target", {{"node", node}, {"path", path}}}});
  }
  void finish() { file_.append("animations", {{"samplers", samplers_}, {"channels", channels_}}); }

 private:
  GltfFile& file_;
  json samplers_ = json::array(), channels_ = json::array();
};

std::vector<float> turn(float x, float y, float z, float radians, float sign = 1.0f) {
  const float length = std::sqrt(x * x + y * y + z * z), s = std::sin(radians / 2) / length;
  return {sign * x * s, sign * y * s, sign * z * s, sign * std::cos(radians / 2)};
}

std::vector<float> joined(std::initializer_list<std::vector<float>> parts) {
  std::vector<float> all;
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

// Three levels; every path and interpolation; a step that mirrors; a sampler whose keys lie apart
// from the others'; a quaternion and its negative as neighbours.
GltfFile hierarchy() {
  GltfFile file;
  const int mesh = add_shape(file, make_tube(0.5f, 1.5f, 12, 3));
  file.append("nodes", {{"children", {1}}, {"mesh", mesh}, {"scale", {1, 0.5, 1}}});
  file.append("nodes", {{"children", {2}}, {"mesh", mesh}, {"translation", {1, 0.5, 0}}});
  file.append("nodes", {{"mesh", mesh}, {"rotation", {0, 0, 1, 0}}});
  file.append("scenes", {{"nodes", {0}}});
  AnimationMaker make(file);
  make.add(0, "translation", {0.0f, 0.4f, 1.3f}, {0, 0, 0, 0.5f, 0, 0, -0.5f, 0.25f, 0}, "STEP");
  make.add(0, "rotation", {0.25f, 0.75f, 1.25f},
           joined({turn(0, 0, 1, 0.1f), turn(1, 1, 0, 2.9f, -1.0f), turn(1, 0, 1, -2.0f)}));
  make.add(1, "scale", {0.0f, 0.5f, 2.0f}, {0, 0, 0, 1, 1, 1,    0.5f, 1,  0,  //
                                            1, 0, 0, 2, 1, 0.5f, 0,    -2, 1,  //
                                            0, 0, 1, 1, 2, 1,    0,    0,  0},
           "CUBICSPLINE");
  make.add(1, "translation", {0.1f, 1.9f}, {1, 0.5f, 0, 0.2f, 1, 0.7f});
  make.add(2, "scale", {0.0f, 0.6f, 1.2f}, {1, 1, 1, -1, 1, 1, 1, 1, -1.5f}, "STEP");
  make.add(2, "rotation", {0.0f, 1.0f}, joined({turn(0, 1, 0, 3.0f), turn(0, 1, 0, -3.0f)}));
  make.finish();
  return file;
}

// Splines of rotations, and rotations as normalised shorts.
GltfFile rotations() {
  GltfFile file;
  const int mesh = add_shape(file, make_tube(0.3f, 2.0f, 9, 2));
  file.append("nodes", {{"mesh", mesh}});
  file.append("nodes", {{"mesh", mesh}, {"translation", {1.5, 0, 0}}});
  file.append("scenes", {{"nodes", {0, 1}}});
  AnimationMaker make(file);
  make.add(0, "rotation", {0.0f, 0.7f, 1.0f},
           joined({{0, 0, 0, 0},
                   turn(0, 0, 1, 0.3f),
                   {0.5f, -1, 0, 0.25f},  //
                   {1, 0, 0.5f, 0},
                   turn(1, 0, 0, 2.0f),
                   {0, 1, 0, -0.5f},  //
                   {0, 0, 2, 0},
                   turn(0, 1, 1, -1.0f),
                   {0, 0, 0, 0}}),
           "CUBICSPLINE");
  std::vector<std::uint16_t> shorts;
  for (const float value :
       joined({turn(1, 0, 0, 0.2f), turn(0, 1, 1, 2.5f), turn(0, 0, 1, 4.0f)})) {
    shorts.push_back(
        static_cast<std::uint16_t>(static_cast<std::int16_t>(std::lround(value * 32767))));
  }
  const int output = file.uint16s("VEC4", shorts);
  file.root["accessors"][output]["componentType"] = 5122;
  file.root["accessors"][output]["normalized"] = true;
  make.add_output(1, "rotation", {0.0f, 0.5f, 1.0f}, output, "LINEAR");
  make.finish();
  return file;
}

// A tube along six joints, six weights a vertex in two sets, of which the last two are 0.
void add_skin(GltfFile& file, Shape& shape, json& attributes, int joints_at, float height) {
  constexpr int kJoints = 6;
  std::vector<std::uint16_t> joints[2];
  std::vector<float> weights[2];
  for (std::size_t v = 0; v < shape.positions.size() / 3; ++v) {
    float weight[8] = {}, sum = 0.0f;
    const float along = shape.positions[3 * v + 1] / height * (kJoints - 1);
    for (int j = 0; j < kJoints; ++j) {
      weight[j] = std::exp(-(along - static_cast<float>(j)) * (along - static_cast<float>(j)));
      sum += weight[j];
    }
    for (int k = 0; k < 8; ++k) {
      joints[k / 4].push_back(static_cast<std::uint16_t>(k < kJoints ? k : 0));
      weights[k / 4].push_back(weight[k] / sum);
    }
  }
  std::vector<float> binds;
  for (int j = 0; j < kJoints; ++j) {
    const float y = -height * static_cast<float>(j) / (kJoints - 1);
    binds.insert(binds.end(), {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, y, 0, 1});
  }
  for (int set = 0; set < 2; ++set) {
    attributes["JOINTS_" + std::to_string(set)] = file.uint16s("VEC4", joints[set]);
    attributes["WEIGHTS_" + std::to_string(set)] = file.floats("VEC4", weights[set]);
  }
  json names = json::array();
  for (int j = 0; j < kJoints; ++j) names.push_back(joints_at + j);
  file.append("skins", {{"joints", names}, {"inverseBindMatrices", file.floats("MAT4", binds)}});
}

void add_joint_nodes(GltfFile& file, int first, float height) {
  for (int j = 0; j < 6; ++j) {
    json node = {{"name", "joint"}};
    if (j > 0) node["translation"] = {0, height / 5, 0};
    if (j < 5) node["children"] = {first + j + 1};
    file.append("nodes", node);
  }
}

void bend_joints(AnimationMaker& make, int first) {
  for (int j = 1; j < 6; ++j) {
    const auto at = static_cast<float>(j);
    make.add(first + j, "rotation", {0.0f, 0.3f * at, 2.0f},
             joined({turn(0, 0, 1, 0.0f), turn(at, 0, 2, 0.5f), turn(0, 1, at, -0.4f)}));
  }
  make.add(first + 3, "scale", {0.0f, 1.0f, 2.0f}, {1, 1, 1, 1.5f, 0.7f, 1.2f, 1, 1, 1});
  make.add(first, "translation", {0.0f, 2.0f}, {0, 0, 0, 0.5f, 0.25f, 0});
}

// The mesh's own node is moved as well, which must change nothing.
GltfFile skin_of_two_sets() {
  GltfFile file;
  Shape shape = make_tube(0.4f, 3.0f, 10, 15);
  json attributes = json::object();
  add_skin(file, shape, attributes, 1, 3.0f);
  const int mesh = add_shape(file, shape, {{"attributes", attributes}});
  file.append("nodes", {{"mesh", mesh}, {"skin", 0}, {"translation", {9, 9, 9}}});
  add_joint_nodes(file, 1, 3.0f);
  file.append("scenes", {{"nodes", {0, 1}}});
  AnimationMaker make(file);
  bend_joints(make, 1);
  make.add(0, "rotation", {0.0f, 1.0f}, joined({turn(1, 0, 0, 0.0f), turn(1, 0, 0, 1.0f)}));
  make.finish();
  return file;
}

// Two targets that move positions and normals, one of them sparse; weights beyond [0, 1].
json morph_targets(GltfFile& file, const Shape& shape) {
  std::vector<float> swell, swell_normals, lean;
  for (std::size_t v = 0; v < shape.positions.size() / 3; ++v) {
    const float* n = &shape.normals[3 * v];
    const float y = shape.positions[3 * v + 1];
    swell.insert(swell.end(), {n[0] * y * 0.3f, 0.0f, n[2] * y * 0.3f});
    swell_normals.insert(swell_normals.end(), {0.0f, -0.3f, 0.0f});
    if (v % 3 == 0) lean.insert(lean.end(), {0.25f * y, 0.1f, 0.0f});
  }
  std::vector<std::uint16_t> places;
  for (std::size_t v = 0; v < shape.positions.size() / 3; v += 3) {
    places.push_back(static_cast<std::uint16_t>(v));
  }
  // Sparse: indices and values are ordinary views, the accessor itself has none.
  const int indices = file.uint16s("SCALAR", places), values = file.floats("VEC3", lean);
  json& accessors = file.root["accessors"];
  const json sparse = {
      {"componentType", 5126},
      {"type", "VEC3"},
      {"count", shape.positions.size() / 3},
      {"min", {0, 0, 0}},
      {"max", accessors[values]["max"]},
      {"sparse",
       {{"count", places.size()},
        {"indices", {{"bufferView", accessors[indices]["bufferView"]}, {"componentType", 5123}}},
        {"values", {{"bufferView", accessors[values]["bufferView"]}}}}}};
  const int sparse_lean = file.append("accessors", sparse);
  return json::array(
      {{{"POSITION", file.floats("VEC3", swell)}, {"NORMAL", file.floats("VEC3", swell_normals)}},
       {{"POSITION", sparse_lean}}});
}

GltfFile morphs() {
  GltfFile file;
  const Shape shape = make_tube(0.5f, 2.0f, 14, 8);
  const int mesh = add_shape(file, shape, {{"targets", morph_targets(file, shape)}});
  file.root["meshes"][mesh]["weights"] = {0.5, 0.0};
  file.append("nodes", {{"mesh", mesh}});
  file.append("nodes", {{"mesh", mesh}, {"translation", {2, 0, 0}}, {"weights", {0.0, 1.0}}});
  file.append("nodes", {{"mesh", mesh}, {"translation", {-2, 0, 0}}});  // is never animated
  file.append("scenes", {{"nodes", {0, 1, 2}}});
  AnimationMaker make(file);
  // In-tangents of all targets, values of all, out-tangents of all.
  make.add(0, "weights", {0.0f, 0.5f, 1.5f},
           {0, 0, 0, 0, 2, -1, 1, 0.5f, 1.2f, 0.3f, -1, 0, 0, 1, 0.2f, -0.4f, 0, 0}, "CUBICSPLINE");
  make.add(1, "weights", {0.0f, 1.0f, 1.2f}, {0, 1, 1, 0, 0.25f, 0.75f});
  make.finish();
  return file;
}

GltfFile skin_morph_and_camera() {
  GltfFile file;
  Shape shape = make_tube(0.4f, 3.0f, 8, 10);
  json attributes = json::object();
  add_skin(file, shape, attributes, 1, 3.0f);
  const int mesh =
      add_shape(file, shape, {{"attributes", attributes}, {"targets", morph_targets(file, shape)}});
  file.append("cameras",
              {{"type", "perspective"}, {"perspective", {{"yfov", 0.9}, {"znear", 0.01}}}});
  file.append("nodes", {{"mesh", mesh}, {"skin", 0}});
  add_joint_nodes(file, 1, 3.0f);
  file.append("nodes", {{"children", {8}}, {"scale", {2, 2, 2}}});
  file.append("nodes", {{"camera", 0}, {"name", "eye"}, {"translation", {0, 0.75, 3}}});
  file.append("scenes", {{"nodes", {0, 1, 7}}});
  AnimationMaker make(file);
  bend_joints(make, 1);
  make.add(0, "weights", {0.0f, 1.0f, 2.0f}, {0, 0, 1, 0.5f, 0, 1}, "STEP");
  make.add(7, "rotation", {0.0f, 2.0f}, joined({turn(0, 1, 0, 0.0f), turn(0, 1, 0, 2.0f)}));
  make.add(8, "translation", {0.0f, 1.0f, 2.0f}, {0, 0.75f, 3, 0, 1, 2.5f, 0, 0.5f, 3});
  make.finish();
  return file;
}

// A node of instances under a parent, both moving, at times mirrored; instances of a mesh that
// morphs, and swells beyond the power of two that its own space is measured in.
GltfFile instances() {
  GltfFile file;
  const Shape shape = make_tube(0.3f, 0.9f, 9, 3);
  const int tube = add_shape(file, shape);
  const int soft = add_shape(file, shape, {{"targets", morph_targets(file, shape)}});
  const auto shown = [&](int mesh, const std::vector<float>& places,
                         const std::vector<float>& turns, const std::vector<float>& sizes) {
    json node = {{"mesh", mesh}};
    node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
        {"TRANSLATION", file.floats("VEC3", places)},
        {"ROTATION", file.floats("VEC4", turns)},
        {"SCALE", file.floats("VEC3", sizes)}};
    return node;
  };
  file.root["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  file.append("nodes", {{"children", {1, 2}}, {"scale", {1, 1.2, 1}}});
  file.append("nodes",
              shown(tube, {0, 0, 0, 1, 0.5f, 0, -1, 0, 0.5f},
                    joined({turn(0, 0, 1, 0.3f), turn(1, 0, 0, 2.0f), turn(0, 1, 1, -1.0f)}),
                    {1, 1, 1, 0.5f, -1, 1, 1, 0.4f, 0.7f}));
  file.append("nodes", shown(soft, {0, 0.5f, 1, 1.5f, -0.5f, -0.5f},
                             joined({turn(1, 1, 0, 1.0f), turn(0, 1, 0, -2.0f)}),
                             {1, 1, 1, -0.8f, 1.1f, 0.6f}));
  file.append("nodes", {{"mesh", tube}, {"translation", {0, -1, 0}}});
  file.append("scenes", {{"nodes", {0, 3}}});
  AnimationMaker make(file);
  make.add(0, "rotation", {0.0f, 0.8f, 1.6f},
           joined({turn(0, 0, 1, 0.0f), turn(1, 1, 0, 1.3f), turn(0, 1, 0, -2.0f)}));
  make.add(1, "translation", {0.2f, 1.0f}, {0, 0, 0, 0.5f, 0.5f, -0.5f});
  make.add(1, "scale", {0.0f, 0.6f, 1.2f}, {1, 1, 1, -1, 1, 1.5f, 1, 2, 1}, "STEP");
  make.add(2, "weights", {0.0f, 0.7f, 1.4f}, {0, 0, 1, 0.5f, 3, -1});
  make.finish();
  return file;
}

}  // namespace

std::vector<AnimatedScene> animated_scenes() {
  return {{"hierarchy", hierarchy()},
          {"rotations", rotations()},
          {"skin_of_two_sets", skin_of_two_sets()},
          {"morphs", morphs()},
          {"skin_morph_and_camera", skin_morph_and_camera()},
          {"instances", instances()}};
}

}  // namespace octrace::tests
