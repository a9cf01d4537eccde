#include <fmt/format.h>

#include <map>
#include <optional>
#include <set>
#include <utility>

#include "backend/scene/flatten_geometry.h"
#include "backend/scene/names.h"
#include "backend/scene/triangulate.h"

namespace octrace::scene {

namespace {

constexpr std::uint64_t kMostIndices = kernels::kNone;  // indices are 32 bits, one value is taken

util::Error over_limit(const gltf::Document& document, std::string message) {
  return {util::Exit::limit, "", std::move(message), document.file, ""};
}

std::optional<std::uint64_t> count_of(const gltf::Document& document,
                                      const tinygltf::Primitive& primitive,
                                      const std::string& attribute) {
  const auto entry = primitive.attributes.find(attribute);
  if (entry == primitive.attributes.end()) return std::nullopt;
  return document.model.accessors[entry->second].count;
}

// Points and lines, to be named in one warning.
class LeftOut {
 public:
  void add(const std::string& mesh) {
    ++primitives_;
    if (names_.size() < 5 && (names_.empty() || names_.back() != mesh)) names_.push_back(mesh);
  }
  void report(std::vector<std::string>& warnings) const {
    if (primitives_ == 0) return;
    warnings.push_back(fmt::format(
        "{} {} of points or lines left out, because only triangles are traced: {}", primitives_,
        primitives_ == 1 ? "primitive" : "primitives", fmt::join(names_, ", ")));
  }

 private:
  std::uint64_t primitives_ = 0;
  std::vector<std::string> names_;
};

class Planner {
 public:
  Planner(const gltf::Document& document, int variant, const util::Limits& limits)
      : document_(document), variant_(variant), limits_(limits) {}

  util::Result<GeometryPlan> plan(const std::vector<int>& nodes) {
    for (const int node : nodes) {
      const int mesh = document_.model.nodes[node].mesh;
      if (mesh < 0) continue;
      const auto& primitives = document_.model.meshes[mesh].primitives;
      for (std::size_t p = 0; p < primitives.size(); ++p) {
        if (auto ok = add(node, mesh, static_cast<int>(p)); !ok) return ok.error();
      }
    }
    left_out_.report(plan_.warnings);
    return std::move(plan_);
  }

 private:
  util::Result<void> add(int node, int mesh, int index) {
    const tinygltf::Primitive& primitive = document_.model.meshes[mesh].primitives[index];
    if (!has_triangles(primitive.mode)) {
      if (counted_.insert({mesh, index}).second) {
        left_out_.add(printable(name_of(document_.model.meshes, mesh, "mesh")));
      }
      return {};
    }
    const auto vertices = count_of(document_, primitive, "POSITION");
    if (!vertices || *vertices == 0) return {};  // the specification: nothing to render
    const std::uint64_t triangles = triangle_count(
        primitive.mode,
        primitive.indices >= 0 ? document_.model.accessors[primitive.indices].count : *vertices);
    if (triangles == 0) return {};

    kernels::Geometry geometry{};
    geometry.first_triangle = static_cast<std::uint32_t>(plan_.triangles);
    geometry.first_vertex = static_cast<std::uint32_t>(plan_.vertices);
    geometry.object = static_cast<std::uint32_t>(node);
    const int material = material_of(mesh, index, primitive);
    geometry.material =
        static_cast<std::uint32_t>(material >= 0 ? material : document_.model.materials.size());
    if (material < 0) plan_.default_material = true;
    const auto reserve = [&](const char* attribute, std::uint64_t& total) {
      if (!primitive.attributes.contains(attribute)) return kernels::kNone;
      const std::uint64_t first = total;
      total += *vertices;
      return static_cast<std::uint32_t>(first);
    };
    // Counts are below 2^32 by check() below, so the sums cannot wrap.
    plan_.triangles += triangles;
    plan_.vertices += *vertices;
    geometry.normals = reserve("NORMAL", plan_.normals);
    geometry.tangents = reserve("TANGENT", plan_.tangents);
    geometry.uv0 = reserve("TEXCOORD_0", plan_.uvs);
    geometry.uv1 = reserve("TEXCOORD_1", plan_.uvs);
    geometry.colors = reserve("COLOR_0", plan_.colors);
    if (auto ok = check(triangles, *vertices, primitive); !ok) return ok;
    geometry.triangle_count = static_cast<std::uint32_t>(triangles);
    geometry.vertex_count = static_cast<std::uint32_t>(*vertices);

    const auto [source, added] = sources_.try_emplace({mesh, index}, plan_.sources.size());
    if (added) plan_.sources.push_back({mesh, index, {}});
    plan_.sources[source->second].instances.push_back(
        {node, static_cast<std::uint32_t>(plan_.geometries.size())});
    plan_.geometries.push_back(geometry);
    return {};
  }

  // Under the chosen variant. Many nodes may share a primitive of many mappings.
  int material_of(int mesh, int index, const tinygltf::Primitive& primitive) {
    if (variant_ < 0) return primitive.material;
    const auto [entry, added] = materials_.try_emplace({mesh, index}, primitive.material);
    if (added) {
      const auto mapped = gltf::variant_materials(primitive);
      if (const auto found = mapped.find(variant_); found != mapped.end()) {
        entry->second = found->second;
      }
    }
    return entry->second;
  }

  util::Result<void> check(std::uint64_t triangles, std::uint64_t vertices,
                           const tinygltf::Primitive& primitive) const {
    if (triangles > limits_.max_triangles || plan_.triangles > limits_.max_triangles) {
      return over_limit(document_,
                        fmt::format("needs {} triangles or more, --max-triangles allows {}",
                                    plan_.triangles, limits_.max_triangles));
    }
    if (plan_.triangles >= kMostIndices || vertices >= kMostIndices ||
        plan_.vertices >= kMostIndices || plan_.uvs >= kMostIndices) {
      return over_limit(document_,
                        fmt::format("needs {} triangles and {} vertices or more; {} of each is the "
                                    "most that can be counted",
                                    plan_.triangles, plan_.vertices, kMostIndices - 1));
    }
    // Skins and the working copy of a mesh are freed again, but they must fit, too.
    const std::uint64_t working =
        vertices * (sizeof(double) * 19 + 8 * primitive.attributes.size());
    if (plan_.bytes() + working > limits_.max_scene_bytes) {
      return over_limit(document_,
                        fmt::format("needs {} bytes or more, --max-scene-bytes allows {}",
                                    plan_.bytes() + working, limits_.max_scene_bytes));
    }
    return {};
  }

  const gltf::Document& document_;
  int variant_;
  const util::Limits& limits_;
  GeometryPlan plan_;
  std::map<std::pair<int, int>, std::size_t> sources_;
  std::map<std::pair<int, int>, int> materials_;
  std::set<std::pair<int, int>> counted_;
  LeftOut left_out_;
};

}  // namespace

std::uint64_t GeometryPlan::bytes() const {
  return triangles * (sizeof(kernels::Triangle) + sizeof(std::uint32_t)) +
         (vertices + normals) * sizeof(kernels::Vec3) +
         (tangents + colors) * sizeof(kernels::Vec4) + uvs * sizeof(kernels::Vec2) +
         geometries.size() * sizeof(kernels::Geometry);
}

util::Result<GeometryPlan> plan_geometry(const gltf::Document& document,
                                         const std::vector<int>& nodes, int variant,
                                         const util::Limits& limits) {
  return Planner(document, variant, limits).plan(nodes);
}

}  // namespace octrace::scene
