#include "tests/support/gltf_reference.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <set>
#include <stdexcept>

namespace octrace::tests {

namespace {

using nlohmann::json;

std::string read_file(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw std::runtime_error("cannot read " + path.string());
  return {std::istreambuf_iterator<char>(stream), {}};
}

std::string from_base64(const std::string& text) {
  std::string bytes;
  std::uint32_t bits = 0;
  int held = 0;
  for (const char c : text) {
    int digit = -1;
    if (c >= 'A' && c <= 'Z') digit = c - 'A';
    if (c >= 'a' && c <= 'z') digit = c - 'a' + 26;
    if (c >= '0' && c <= '9') digit = c - '0' + 52;
    if (c == '+') digit = 62;
    if (c == '/') digit = 63;
    if (digit < 0) continue;
    bits = bits << 6 | static_cast<std::uint32_t>(digit);
    held += 6;
    if (held < 8) continue;
    held -= 8;
    bytes += static_cast<char>(bits >> held & 0xff);
  }
  return bytes;
}

int component_count(const std::string& type) {
  if (type == "SCALAR") return 1;
  if (type == "VEC2") return 2;
  if (type == "VEC3") return 3;
  return type == "VEC4" ? 4 : 16;
}

Real3 operator+(const Real3& a, const Real3& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
Real3 operator-(const Real3& a, const Real3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Real3 operator*(double s, const Real3& a) { return {s * a[0], s * a[1], s * a[2]}; }
double dot(const Real3& a, const Real3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Real3 cross(const Real3& a, const Real3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Real3 normalised(const Real3& a) {
  const double length = std::sqrt(dot(a, a));
  return length > 0.0 ? (1.0 / length) * a : a;
}

constexpr const char* kInstancing = "EXT_mesh_gpu_instancing";

const Matrix kIdentity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

Matrix times(const Matrix& a, const Matrix& b) {
  Matrix c{};
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) {
      for (int k = 0; k < 4; ++k) c[4 * column + row] += a[4 * k + row] * b[4 * column + k];
    }
  }
  return c;
}

Real3 transformed(const Matrix& m, const Real3& p, double w) {
  Real3 q;
  for (int row = 0; row < 3; ++row) {
    q[row] = m[row] * p[0] + m[4 + row] * p[1] + m[8 + row] * p[2] + m[12 + row] * w;
  }
  return q;
}

double determinant(const Matrix& m) {
  return dot({m[0], m[1], m[2]}, cross({m[4], m[5], m[6]}, {m[8], m[9], m[10]}));
}

// Normals are planes: those of the transformed tangents' cross product.
Real3 transformed_normal(const Matrix& m, const Real3& n) {
  const Real3 n1 = normalised(n);
  const Real3 helper = std::abs(n1[0]) < 0.5 ? Real3{1, 0, 0} : Real3{0, 1, 0};
  const Real3 t = normalised(cross(n1, helper)), b = cross(n1, t);
  const Real3 normal = normalised(cross(transformed(m, t, 0), transformed(m, b, 0)));
  return determinant(m) < 0 ? -1.0 * normal : normal;
}

// v' = q v q*, written out as a matrix from the columns' images.
Matrix trs(const Real3& t, const std::array<double, 4>& q, const Real3& s) {
  const Real3 u{q[0], q[1], q[2]};
  Matrix m = kIdentity;
  for (int c = 0; c < 3; ++c) {
    Real3 v{};
    v[c] = 1.0;
    const Real3 uv = cross(u, v), uuv = cross(u, uv);
    const Real3 image = s[c] * (v + 2.0 * q[3] * uv + 2.0 * uuv);
    for (int r = 0; r < 3; ++r) m[4 * c + r] = image[r];
    m[12 + c] = t[c];
  }
  return m;
}

// The value of one channel, `width` numbers, from the formulas of appendix C.
std::vector<double> sample(const std::vector<double>& keys, const std::vector<double>& values,
                           const std::string& mode, bool rotation, std::size_t width, double t) {
  const bool cubic = mode == "CUBICSPLINE";
  const auto part = [&](std::size_t key, int which) {  // 0 in-tangent, 1 value, 2 out-tangent
    const std::size_t at =
        cubic ? (3 * key + static_cast<std::size_t>(which)) * width : key * width;
    return std::vector<double>(values.begin() + std::ptrdiff_t(at),
                               values.begin() + std::ptrdiff_t(at + width));
  };
  std::vector<double> out;
  std::size_t k = 0;
  while (k + 1 < keys.size() && keys[k + 1] <= t) ++k;
  if (t <= keys.front()) {
    out = part(0, 1);
  } else if (k + 1 == keys.size() || mode == "STEP") {
    out = part(k, 1);
  } else {
    const double td = keys[k + 1] - keys[k], u = (t - keys[k]) / td;
    const auto a = part(k, 1), b = part(k + 1, 1);
    out.resize(width);
    if (cubic) {
      const auto leave = part(k, 2), arrive = part(k + 1, 0);
      for (std::size_t i = 0; i < width; ++i) {
        out[i] = (2 * u * u * u - 3 * u * u + 1) * a[i] +
                 td * (u * u * u - 2 * u * u + u) * leave[i] + (-2 * u * u * u + 3 * u * u) * b[i] +
                 td * (u * u * u - u * u) * arrive[i];
      }
    } else if (rotation) {
      // Keys are rotations, which rounding to shorts must not make longer or shorter.
      double d = 0, aa = 0, bb = 0;
      for (int i = 0; i < 4; ++i) aa += a[i] * a[i], bb += b[i] * b[i];
      for (int i = 0; i < 4; ++i) d += a[i] * b[i] / std::sqrt(aa * bb);
      const double angle = std::acos(std::min(std::abs(d), 1.0)), sign = d < 0 ? -1 : 1;
      for (int i = 0; i < 4; ++i) {
        const double p = a[i] / std::sqrt(aa), q = b[i] / std::sqrt(bb);
        out[i] = angle < 1e-6 ? (1 - u) * p + u * sign * q
                              : (std::sin(angle * (1 - u)) * p + sign * std::sin(angle * u) * q) /
                                    std::sin(angle);
      }
    } else {
      for (std::size_t i = 0; i < width; ++i) out[i] = (1 - u) * a[i] + u * b[i];
    }
  }
  if (rotation) {
    double norm = 0;
    for (const double x : out) norm += x * x;
    for (double& x : out) x /= std::sqrt(norm);
  }
  return out;
}

std::vector<double> numbers_or(const json& node, const char* name, std::vector<double> otherwise) {
  return node.contains(name) ? node[name].get<std::vector<double>>() : otherwise;
}

}  // namespace

GltfReference::GltfReference(const std::string& path) {
  std::string text = read_file(path), binary;
  if (text.starts_with("glTF")) {
    std::uint32_t length = 0;
    std::memcpy(&length, text.data() + 12, 4);
    if (text.size() > 28 + length) binary = text.substr(28 + length);
    text = text.substr(20, length);
  }
  json_ = json::parse(text);
  for (const json& buffer : json_.value("buffers", json::array())) {
    if (!buffer.contains("uri")) {
      buffers_.push_back(binary);
      continue;
    }
    const std::string uri = buffer["uri"];
    buffers_.push_back(uri.starts_with("data:")
                           ? from_base64(uri.substr(uri.find(',') + 1))
                           : read_file(std::filesystem::path(path).parent_path() / uri));
  }
}

std::vector<double> GltfReference::raw(const json& where, int component, int components,
                                       bool normalised, std::size_t count) const {
  const json& view = json_["bufferViews"][where["bufferView"].get<std::size_t>()];
  const int bytes = component == 5120 || component == 5121   ? 1
                    : component == 5122 || component == 5123 ? 2
                                                             : 4;
  const std::size_t stride = view.value("byteStride", bytes * components);
  const std::string& buffer = buffers_[view["buffer"].get<std::size_t>()];
  const char* data = buffer.data() + view.value("byteOffset", 0u) + where.value("byteOffset", 0u);
  std::vector<double> out;
  for (std::size_t i = 0; i < count; ++i) {
    for (int c = 0; c < components; ++c) {
      const char* from = data + i * stride + static_cast<std::size_t>(c * bytes);
      const auto as = [&]<class T>(T value, double most) {
        std::memcpy(&value, from, sizeof value);
        return normalised ? std::max(static_cast<double>(value) / most, -1.0)
                          : static_cast<double>(value);
      };
      out.push_back(component == 5120   ? as(std::int8_t{}, 127.0)
                    : component == 5121 ? as(std::uint8_t{}, 255.0)
                    : component == 5122 ? as(std::int16_t{}, 32767.0)
                    : component == 5123 ? as(std::uint16_t{}, 65535.0)
                    : component == 5125 ? as(std::uint32_t{}, 1.0)
                                        : as(float{}, 1.0));
    }
  }
  return out;
}

std::vector<double> GltfReference::accessor(int index) const {
  const json& accessor = json_["accessors"][static_cast<std::size_t>(index)];
  const int components = component_count(accessor["type"]);
  const int component = accessor["componentType"];
  const std::size_t count = accessor["count"];
  const bool normalised = accessor.value("normalized", false);
  std::vector<double> values(count * static_cast<std::size_t>(components), 0.0);
  if (accessor.contains("bufferView"))
    values = raw(accessor, component, components, normalised, count);
  if (!accessor.contains("sparse")) return values;
  const json& sparse = accessor["sparse"];
  const std::size_t some = sparse["count"];
  const auto places = raw(sparse["indices"], sparse["indices"]["componentType"], 1, false, some);
  const auto changed = raw(sparse["values"], component, components, normalised, some);
  for (std::size_t i = 0; i < some; ++i) {
    for (int c = 0; c < components; ++c) {
      values[static_cast<std::size_t>(places[i]) * components + c] = changed[i * components + c];
    }
  }
  return values;
}

std::vector<double> GltfReference::key_times(int animation) const {
  std::set<double> times;
  for (const json& sampler : json_["animations"][static_cast<std::size_t>(animation)]["samplers"]) {
    for (const double t : accessor(sampler["input"])) times.insert(t);
  }
  return {times.begin(), times.end()};
}

GltfReference::Frame GltfReference::frame(int animation, std::optional<double> seconds) const {
  // Every node's own state, then what the animation says of it.
  const json& nodes = json_["nodes"];
  struct State {
    std::vector<double> t, r, s, weights;
  };
  std::vector<State> states;
  for (const json& node : nodes) {
    State state{numbers_or(node, "translation", {0, 0, 0}),
                numbers_or(node, "rotation", {0, 0, 0, 1}),
                numbers_or(node, "scale", {1, 1, 1}),
                {}};
    if (node.contains("mesh")) {
      const json& mesh = json_["meshes"][node["mesh"].get<std::size_t>()];
      const std::size_t targets = mesh["primitives"][0].value("targets", json::array()).size();
      state.weights = numbers_or(node, "weights",
                                 numbers_or(mesh, "weights", std::vector<double>(targets, 0.0)));
    }
    states.push_back(state);
  }
  if (seconds) {
    const json& source = json_["animations"][static_cast<std::size_t>(animation)];
    for (const json& channel : source["channels"]) {
      const json& sampler = source["samplers"][channel["sampler"].get<std::size_t>()];
      const std::string path = channel["target"]["path"];
      State& state = states[channel["target"]["node"].get<std::size_t>()];
      std::vector<double>& value = path == "translation" ? state.t
                                   : path == "rotation"  ? state.r
                                   : path == "scale"     ? state.s
                                                         : state.weights;
      value = sample(accessor(sampler["input"]), accessor(sampler["output"]),
                     sampler.value("interpolation", "LINEAR"), path == "rotation", value.size(),
                     *seconds);
    }
  }

  Frame frame;
  frame.worlds.assign(nodes.size(), kIdentity);
  std::vector<bool> shown(nodes.size());
  const std::function<void(std::size_t, const Matrix&, bool)> place =
      [&](std::size_t index, const Matrix& parent, bool show) {
        const json& node = nodes[index];
        const State& state = states[index];
        Matrix local;
        if (node.contains("matrix")) {
          local = node["matrix"].get<Matrix>();
        } else {
          double norm = 0;
          for (const double x : state.r) norm += x * x;
          norm = std::sqrt(norm);
          local = trs({state.t[0], state.t[1], state.t[2]},
                      {state.r[0] / norm, state.r[1] / norm, state.r[2] / norm, state.r[3] / norm},
                      {state.s[0], state.s[1], state.s[2]});
        }
        frame.worlds[index] = times(parent, local);
        shown[index] = shown[index] || show;
        for (const json& child : node.value("children", json::array())) {
          place(child, frame.worlds[index], show);
        }
      };
  std::vector<bool> is_child(nodes.size());
  for (const json& node : nodes) {
    for (const json& child : node.value("children", json::array())) is_child[child] = true;
  }
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (!is_child[i]) place(i, kIdentity, false);
  }
  // The scene's roots may be anywhere in the forest: show what hangs from them.
  const std::function<void(std::size_t)> show = [&](std::size_t index) {
    shown[index] = true;
    for (const json& child : nodes[index].value("children", json::array())) show(child);
  };
  for (const json& root : json_["scenes"][json_.value("scene", 0u)]["nodes"]) show(root);

  auto next_instance = static_cast<std::uint32_t>(nodes.size());
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    const json& node = nodes[n];
    if (!shown[n] || !node.contains("mesh")) continue;
    if (node.contains("extensions") && node["extensions"].contains(kInstancing)) {
      for (const Matrix& instance : instances(node["extensions"][kInstancing]["attributes"])) {
        frame.instances.push_back(times(frame.worlds[n], instance));
        append_mesh(node, frame.instances.back(), states[n].weights, frame, next_instance++);
      }
      continue;
    }
    append_mesh(node, frame.worlds[n], states[n].weights, frame, static_cast<std::uint32_t>(n));
  }
  return frame;
}

std::vector<Matrix> GltfReference::instances(const json& attributes) const {
  std::vector<Matrix> matrices;
  const auto values = [&](const char* name) {
    return attributes.contains(name) ? accessor(attributes[name]) : std::vector<double>();
  };
  const auto t = values("TRANSLATION"), r = values("ROTATION"), s = values("SCALE");
  const std::size_t count = std::max({t.size() / 3, r.size() / 4, s.size() / 3});
  for (std::size_t i = 0; i < count; ++i) {
    std::array<double, 4> q{0, 0, 0, 1};
    if (!r.empty()) {
      double norm = 0;
      for (std::size_t k = 4 * i; k < 4 * i + 4; ++k) norm += r[k] * r[k];
      for (std::size_t k = 0; k < 4; ++k) q[k] = r[4 * i + k] / std::sqrt(norm);
    }
    const auto vector = [&](const std::vector<double>& from, double otherwise) {
      if (from.empty()) return Real3{otherwise, otherwise, otherwise};
      return Real3{from[3 * i], from[3 * i + 1], from[3 * i + 2]};
    };
    matrices.push_back(trs(vector(t, 0.0), q, vector(s, 1.0)));
  }
  return matrices;
}

void GltfReference::append_mesh(const json& node, const Matrix& world,
                                const std::vector<double>& morph, Frame& frame,
                                std::uint32_t object) const {
  for (const json& primitive : json_["meshes"][node["mesh"].get<std::size_t>()]["primitives"]) {
    const json& attributes = primitive["attributes"];
    std::vector<double> p = accessor(attributes["POSITION"]), normals;
    if (attributes.contains("NORMAL")) normals = accessor(attributes["NORMAL"]);
    const json targets = primitive.value("targets", json::array());
    for (std::size_t k = 0; k < targets.size(); ++k) {
      const auto add = [&](const char* name, std::vector<double>& to) {
        if (!targets[k].contains(name) || to.empty()) return;
        const auto delta = accessor(targets[k][name]);
        for (std::size_t i = 0; i < to.size(); ++i) to[i] += morph[k] * delta[i];
      };
      add("POSITION", p);
      add("NORMAL", normals);
    }
    const std::size_t vertices = p.size() / 3;
    std::vector<Matrix> matrices(vertices, world);
    const bool skinned = node.contains("skin") && attributes.contains("JOINTS_0");
    if (skinned) {
      const json& skin = json_["skins"][node["skin"].get<std::size_t>()];
      std::vector<double> binds;
      if (skin.contains("inverseBindMatrices")) binds = accessor(skin["inverseBindMatrices"]);
      matrices.assign(vertices, Matrix{});
      std::vector<double> total(vertices, 0.0);
      for (int set = 0; attributes.contains("JOINTS_" + std::to_string(set)); ++set) {
        const auto joints = accessor(attributes["JOINTS_" + std::to_string(set)]);
        const auto weights = accessor(attributes["WEIGHTS_" + std::to_string(set)]);
        for (std::size_t i = 0; i < 4 * vertices; ++i) {
          const auto joint = static_cast<std::size_t>(joints[i]);
          Matrix bind = kIdentity;
          if (!binds.empty())
            std::copy_n(binds.begin() + std::ptrdiff_t(16 * joint), 16, bind.begin());
          const Matrix m = times(frame.worlds[skin["joints"][joint].get<std::size_t>()], bind);
          for (std::size_t e = 0; e < 16; ++e) matrices[i / 4][e] += weights[i] * m[e];
          total[i / 4] += weights[i];
        }
      }
      for (std::size_t v = 0; v < vertices; ++v) {
        for (double& e : matrices[v]) e /= total[v];
      }
    }
    std::vector<std::size_t> corners;
    if (primitive.contains("indices")) {
      for (const double i : accessor(primitive["indices"])) {
        corners.push_back(static_cast<std::size_t>(i));
      }
    } else {
      for (std::size_t i = 0; i < vertices; ++i) corners.push_back(i);
    }
    const bool two_sided =
        primitive.contains("material") &&
        json_["materials"][primitive["material"].get<std::size_t>()].value("doubleSided", false);
    for (std::size_t i = 0; i + 2 < corners.size(); i += 3) {
      ReferenceTriangle triangle{{}, {}, two_sided, object};
      for (int c = 0; c < 3; ++c) {
        const std::size_t v = corners[i + static_cast<std::size_t>(c)];
        triangle.corners[c] = transformed(matrices[v], {p[3 * v], p[3 * v + 1], p[3 * v + 2]}, 1);
        if (!normals.empty()) {
          triangle.normals[c] = transformed_normal(
              matrices[v], {normals[3 * v], normals[3 * v + 1], normals[3 * v + 2]});
        }
      }
      if (!skinned && determinant(world) < 0) {
        std::swap(triangle.corners[1], triangle.corners[2]);
        std::swap(triangle.normals[1], triangle.normals[2]);
      }
      frame.triangles.push_back(triangle);
    }
  }
}

ReferenceRay reference_ray(const Matrix& camera, double yfov, int width, int height, double x,
                           double y) {
  // A camera is not scaled by its node.
  const Real3 back = normalised({camera[8], camera[9], camera[10]});
  const Real3 right = normalised({camera[0], camera[1], camera[2]});
  const Real3 up = normalised({camera[4], camera[5], camera[6]});
  const double half = std::tan(yfov / 2);
  const double across = (2 * x / width - 1) * half * width / height,
               above = (1 - 2 * y / height) * half;
  return {{camera[12], camera[13], camera[14]}, across * right + above * up - back, 0.0, 1e30};
}

std::optional<ReferenceHit> reference_cast(const std::vector<ReferenceTriangle>& triangles,
                                           const ReferenceRay& ray, double grow) {
  std::optional<ReferenceHit> nearest;
  for (const ReferenceTriangle& triangle : triangles) {
    const Real3 e1 = triangle.corners[1] - triangle.corners[0];
    const Real3 e2 = triangle.corners[2] - triangle.corners[0];
    const Real3 p = cross(ray.direction, e2);
    const double det = dot(e1, p);
    if (det == 0.0 || (det < 0.0 && !triangle.double_sided)) continue;
    const Real3 s = ray.origin - triangle.corners[0];
    const double u = dot(s, p) / det;
    if (u < -grow || u > 1 + grow) continue;
    const Real3 q = cross(s, e1);
    const double v = dot(ray.direction, q) / det;
    if (v < -grow || u + v > 1 + grow) continue;
    const double t = dot(e2, q) / det;
    if (t < ray.tmin || t > ray.tmax || (nearest && t >= nearest->depth)) continue;
    const Real3 n = cross(e1, e2), &d = ray.direction;
    nearest = ReferenceHit{t, std::abs(dot(n, d)) / std::sqrt(dot(n, n) * dot(d, d)),
                           normalised((1 - u - v) * triangle.normals[0] + u * triangle.normals[1] +
                                      v * triangle.normals[2]),
                           triangle.node};
  }
  return nearest;
}

}  // namespace octrace::tests
