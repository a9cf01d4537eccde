// The entries of a job's "cameras".
#include <fmt/format.h>

#include <filesystem>
#include <glm/matrix.hpp>

#include "backend/batch/camera_sets.h"

namespace octrace::batch {

namespace {

using util::Result;

constexpr double kPi = 3.141592653589793;
constexpr double kFar = 1e30;  // positions must stay within the range of float

Result<glm::dvec3> parse_point(const JsonAt& json) {
  if (auto count = json.array(3, 3); !count) return count.error();
  glm::dvec3 point(0.0);
  for (int c = 0; c < 3; ++c) {
    auto value = json.at(static_cast<std::size_t>(c)).number(-kFar, kFar);
    if (!value) return value.error();
    point[c] = *value;
  }
  return point;
}

Result<void> parse_intrinsics(const JsonAt& json, scene::Camera& camera) {
  if (auto ok = json.object({"fx", "fy", "cx", "cy", "width", "height"},
                            {"fx", "fy", "cx", "cy", "width", "height"});
      !ok)
    return ok;
  camera.type = scene::CameraType::pinhole;
  const struct {
    const char* key;
    double least;
    double& into;
  } members[] = {{"fx", 1e-9, camera.fx}, {"fy", 1e-9, camera.fy},    {"cx", -1e9, camera.cx},
                 {"cy", -1e9, camera.cy}, {"width", 1, camera.width}, {"height", 1, camera.height}};
  for (const auto& member : members) {
    auto value = json.at(member.key).number(member.least, 1e9);
    if (!value) return value.error();
    member.into = *value;
  }
  return {};
}

Result<double> parse_fov(const JsonAt& json) { return json.number(1e-3, 179.999); }

Result<scene::Camera> parse_lens(const JsonAt& json) {
  if (json.has("fov") == json.has("intrinsics")) {
    return json.error("needs either \"fov\" or \"intrinsics\"");
  }
  scene::Camera camera;
  if (json.has("fov")) {
    auto fov = parse_fov(json.at("fov"));
    if (!fov) return fov.error();
    camera.yfov = *fov * kPi / 180.0;
    return camera;
  }
  if (auto ok = parse_intrinsics(json.at("intrinsics"), camera); !ok) return ok.error();
  return camera;
}

// A word of two; the first is the default.
Result<bool> is_second(const JsonAt& json, const char* key, const char* first, const char* second) {
  if (!json.has(key)) return false;
  const Json& value = json.at(key).value();
  if (value == first) return false;
  if (value == second) return true;
  return json.at(key).needs(fmt::format("one of {}, {}", first, second));
}

Result<GivenCameras> parse_matrices(const JsonAt& json, const util::Limits& limits) {
  if (auto ok = json.object(
          {"matrices", "convention", "pose", "names", "name", "fov", "intrinsics"}, {"matrices"});
      !ok)
    return ok.error();
  auto lens = parse_lens(json);
  if (!lens) return lens.error();
  auto opencv = is_second(json, "convention", "opengl", "opencv");
  if (!opencv) return opencv.error();
  auto inverse = is_second(json, "pose", "camera_to_world", "world_to_camera");
  if (!inverse) return inverse.error();
  std::string name = "camera";
  if (auto ok = read_member(json, "name", name, [](const JsonAt& at) { return at.text(); }); !ok)
    return ok.error();
  const JsonAt list = json.at("matrices");
  auto count = list.array(1, limits.max_views);
  if (!count) return count.error();
  if (json.has("names")) {
    if (auto names = json.at("names").array(*count, *count); !names) return names.error();
  }
  GivenCameras given;
  for (std::size_t i = 0; i < *count; ++i) {
    scene::Camera camera = *lens;
    auto matrix = parse_matrix(list.at(i));
    if (!matrix) return matrix.error();
    camera.matrix = *matrix;
    if (*inverse) {
      camera.matrix = glm::inverse(camera.matrix);
      if (!std::isfinite(camera.matrix[3].x + camera.matrix[3].y + camera.matrix[3].z)) {
        return list.at(i).needs("a matrix that has an inverse");
      }
    }
    if (*opencv) {  // its Y and Z axes point the other way
      camera.matrix[1] = -camera.matrix[1];
      camera.matrix[2] = -camera.matrix[2];
    }
    camera.name = numbered(name, i, *count);
    if (json.has("names")) {
      auto text = json.at("names").at(i).text();
      if (!text) return text.error();
      camera.name = *text;
    }
    given.cameras.push_back(std::move(camera));
  }
  return given;
}

Result<OrbitCameras> parse_orbit(const JsonAt& json, const std::string& kind,
                                 const util::Limits& limits) {
  OrbitCameras orbit;
  orbit.random = kind == "hemisphere";
  orbit.name = kind;
  const auto checked =
      orbit.random
          ? json.object({"n", "seed", "fov", "distance", "target", "name"}, {"n"})
          : json.object({"n", "elevation", "start", "fov", "distance", "target", "name"}, {"n"});
  if (!checked) return checked.error();
  const auto most = static_cast<std::int64_t>(std::min<std::uint64_t>(limits.max_views, 1u << 30));
  auto n = json.at("n").integer(1, most);
  if (!n) return n.error();
  orbit.n = static_cast<std::uint64_t>(*n);
  if (auto ok = read_member(json, "seed", orbit.seed,
                            [](const JsonAt& at) { return at.integer(0, 0xffffffffll); });
      !ok)
    return ok.error();
  if (auto ok = read_member(json, "elevation", orbit.elevation,
                            [](const JsonAt& at) { return at.number(-90, 90); });
      !ok)
    return ok.error();
  if (auto ok = read_member(json, "start", orbit.start,
                            [](const JsonAt& at) { return at.number(-360, 360); });
      !ok)
    return ok.error();
  if (auto ok = read_member(json, "fov", orbit.fov, parse_fov); !ok) return ok.error();
  if (auto ok = read_member(json, "distance", orbit.distance,
                            [](const JsonAt& at) { return at.number(1e-9, 1e9); });
      !ok)
    return ok.error();
  if (auto ok = read_member(json, "target", orbit.target, parse_point); !ok) return ok.error();
  if (auto ok = read_member(json, "name", orbit.name, [](const JsonAt& at) { return at.text(); });
      !ok)
    return ok.error();
  return orbit;
}

Result<CameraEntry> parse_entry(const JsonAt& json, const Job& job, const util::Limits& limits) {
  if (json.value().is_number()) {
    auto index = json.integer(0, 1 << 24);
    if (!index) return index.error();
    return CameraEntry(NamedCamera{*index});
  }
  if (json.value().is_string()) {
    auto text = json.text();
    if (!text) return text.error();
    if (*text == "all") return CameraEntry(AllCameras{});
    if (!text->ends_with(".json")) return CameraEntry(NamedCamera{*text});
    auto cameras = scene::read_camera_path(path_beside(job.folder, *text), limits);
    if (!cameras) return cameras.error();
    return CameraEntry(GivenCameras{std::move(*cameras)});
  }
  if (json.has("matrices")) {
    auto given = parse_matrices(json, limits);
    if (!given) return given.error();
    return CameraEntry(std::move(*given));
  }
  for (const char* kind : {"turntable", "hemisphere"}) {
    if (!json.has(kind)) continue;
    if (auto ok = json.object({kind}, {}); !ok) return ok.error();
    auto orbit = parse_orbit(json.at(kind), kind, limits);
    if (!orbit) return orbit.error();
    return CameraEntry(std::move(*orbit));
  }
  if (json.has("nerfstudio")) {
    if (auto ok = json.object({"nerfstudio"}, {}); !ok) return ok.error();
    auto text = json.at("nerfstudio").text();
    if (!text) return text.error();
    auto cameras = read_transforms(path_beside(job.folder, *text), job.size, limits);
    if (!cameras) return cameras.error();
    return CameraEntry(GivenCameras{std::move(*cameras)});
  }
  return json.needs(
      "\"all\", a camera's name or index, FILE.json, or an object with matrices, turntable, "
      "hemisphere or nerfstudio");
}

}  // namespace

Result<glm::dmat4> parse_matrix(const JsonAt& json) {
  const Json& value = json.value();
  const bool rows = value.is_array() && !value.empty() && value[0].is_array();
  auto count = rows ? json.array(3, 4) : json.array(16, 16);
  if (!count) return count.error();
  glm::dmat4 matrix(1.0);
  for (std::size_t i = 0; i < *count; ++i) {
    if (!rows) {
      auto number = json.at(i).number(-kFar, kFar);
      if (!number) return number.error();
      matrix[static_cast<int>(i / 4)][static_cast<int>(i % 4)] = *number;
      continue;
    }
    const JsonAt row = json.at(i);
    if (auto four = row.array(4, 4); !four) return four.error();
    for (std::size_t c = 0; c < 4; ++c) {
      auto number = row.at(c).number(-kFar, kFar);
      if (!number) return number.error();
      matrix[static_cast<int>(c)][static_cast<int>(i)] = *number;
    }
  }
  for (int c = 0; c < 4; ++c) {
    if (matrix[c][3] != (c == 3 ? 1.0 : 0.0)) {
      return json.needs("a matrix whose last row is 0 0 0 1 (16 numbers are by columns)");
    }
    if (c < 3 && glm::dvec3(matrix[c]) == glm::dvec3(0.0)) {
      return json.needs("a matrix without a column of zeros");
    }
  }
  return matrix;
}

Result<std::vector<CameraEntry>> parse_cameras(const JsonAt& json, const Job& job,
                                               const util::Limits& limits) {
  std::vector<CameraEntry> entries;
  if (json.value().is_string()) {
    auto entry = parse_entry(json, job, limits);
    if (!entry) return entry.error();
    entries.push_back(std::move(*entry));
    return entries;
  }
  auto count = json.array(1, limits.max_views);
  if (!count) return count.error();
  for (std::size_t i = 0; i < *count; ++i) {
    auto entry = parse_entry(json.at(i), job, limits);
    if (!entry) return entry.error();
    entries.push_back(std::move(*entry));
  }
  return entries;
}

}  // namespace octrace::batch
