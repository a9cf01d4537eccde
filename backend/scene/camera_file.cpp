// The file of --camera FILE.json. Small, but input like any other: every value is checked for its
// type and range, and unknown members are errors, because a misspelt one would go unnoticed.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string_view>

#include "backend/gltf/issues.h"
#include "backend/gltf/json_text.h"
#include "backend/scene/camera.h"

namespace octrace::scene {

namespace {

using nlohmann::json;

constexpr std::size_t kMaxBytes = 1 << 20;  // a camera takes some 300
constexpr std::size_t kChunk = 1 << 16;
constexpr double kPi = 3.141592653589793;

class Reader {
 public:
  Reader(std::string file, std::string at, json object)
      : file_(std::move(file)), at_(std::move(at)), object_(std::move(object)) {}

  util::Error error(const std::string& pointer, std::string code, std::string message) const {
    return {util::Exit::invalid_input, std::move(code), std::move(message), file_, at_ + pointer};
  }

  bool has(const char* key) const { return object_.contains(key); }

  // Leaves value as it is where the member is missing and not required.
  util::Result<void> number(const char* key, bool required, double least, bool least_allowed,
                            double* value) const {
    const auto member = object_.find(key);
    const std::string pointer = fmt::format("/{}", key);
    if (member == object_.end()) {
      if (!required) return {};
      return error("", "UNDEFINED_PROPERTY", fmt::format("needs \"{}\"", key));
    }
    if (!member->is_number()) {
      return error(pointer, "TYPE_MISMATCH", "needs a number, got " + member->dump());
    }
    const double number = member->get<double>();
    if (!std::isfinite(number) || number < least || (number == least && !least_allowed)) {
      return error(pointer, "VALUE_NOT_IN_RANGE",
                   fmt::format("needs a number {} {}, got {}", least_allowed ? ">=" : ">", least,
                               member->dump()));
    }
    *value = number;
    return {};
  }

  util::Result<void> only(std::initializer_list<std::string_view> keys) const {
    for (const auto& [key, value] : object_.items()) {
      if (std::find(keys.begin(), keys.end(), key) != keys.end()) continue;
      return error(pointer_to(key), "UNEXPECTED_PROPERTY",
                   fmt::format("unknown here; known are {}", fmt::join(keys, ", ")));
    }
    return {};
  }

  const json& object() const { return object_; }

 private:
  // RFC 6901: ~ and / are written ~0 and ~1.
  static std::string pointer_to(std::string_view key) {
    std::string pointer = "/";
    for (const char c : key) {
      if (c == '~') {
        pointer += "~0";
      } else if (c == '/') {
        pointer += "~1";
      } else {
        pointer += c;
      }
    }
    return pointer;
  }

  std::string file_, at_;  // at_: the object's own pointer in the file
  json object_;
};

util::Result<glm::dmat4> read_matrix(const Reader& reader) {
  const auto member = reader.object().find("matrix");
  if (member == reader.object().end()) {
    return reader.error("", "UNDEFINED_PROPERTY",
                        "needs \"matrix\", camera to world, 16 numbers by columns");
  }
  if (!member->is_array()) {
    return reader.error("/matrix", "TYPE_MISMATCH", "needs an array, got " + member->dump());
  }
  if (member->size() != 16) {
    return reader.error("/matrix", "ARRAY_LENGTH_NOT_IN_LIST",
                        fmt::format("needs 16 numbers, got {}", member->size()));
  }
  glm::dmat4 matrix;
  for (int i = 0; i < 16; ++i) {
    const json& value = (*member)[i];
    const std::string pointer = fmt::format("/matrix/{}", i);
    if (!value.is_number()) {
      return reader.error(pointer, "TYPE_MISMATCH", "needs a number, got " + value.dump());
    }
    const double number = value.get<double>();
    // Positions must stay in the range of float; beyond it a ray has no origin.
    if (!(std::abs(number) <= 1e30)) {
      return reader.error(pointer, "VALUE_NOT_IN_RANGE",
                          "needs a number within +-1e30, got " + value.dump());
    }
    matrix[i / 4][i % 4] = number;
  }
  for (int column = 0; column < 4; ++column) {
    if (matrix[column][3] == (column == 3 ? 1.0 : 0.0)) continue;
    return reader.error(fmt::format("/matrix/{}", 4 * column + 3), "VALUE_NOT_IN_LIST",
                        "the matrix's last row must be 0 0 0 1 (it is stored by columns)");
  }
  for (int column = 0; column < 3; ++column) {
    const glm::dvec4& c = matrix[column];
    if (c.x != 0.0 || c.y != 0.0 || c.z != 0.0) continue;
    return reader.error(fmt::format("/matrix/{}", 4 * column), "NODE_MATRIX_NON_TRS",
                        fmt::format("column {} is zero: the camera has no such axis", column));
  }
  return matrix;
}

util::Result<void> read_lens(const Reader& reader, Camera& camera) {
  const bool in_pixels = reader.has("fx") || reader.has("fy");
  const bool has_type = reader.has("type");
  if (!has_type && !in_pixels) return reader.error("", "UNDEFINED_PROPERTY", "needs \"type\"");
  const json type = has_type ? reader.object().at("type") : json("pinhole");
  if (!type.is_string()) {
    return reader.error("/type", "TYPE_MISMATCH", "needs a string, got " + type.dump());
  }
  if (type == "orthographic") {
    camera.type = CameraType::orthographic;
    if (auto ok = reader.only({"name", "type", "matrix", "xmag", "ymag", "znear", "zfar"}); !ok)
      return ok;
    if (auto ok = reader.number("xmag", true, 0.0, false, &camera.xmag); !ok) return ok;
    return reader.number("ymag", true, 0.0, false, &camera.ymag);
  }
  if (type == "perspective" && !in_pixels) {
    camera.type = CameraType::perspective;
    if (auto ok = reader.only({"name", "type", "matrix", "yfov", "znear", "zfar"}); !ok) return ok;
    if (auto ok = reader.number("yfov", true, 0.0, false, &camera.yfov); !ok) return ok;
    if (camera.yfov >= kPi) {
      return reader.error("/yfov", "VALUE_NOT_IN_RANGE",
                          fmt::format("needs radians below pi, got {}", camera.yfov));
    }
    return {};
  }
  if (type != "pinhole" && type != "perspective") {
    return reader.error("/type", "VALUE_NOT_IN_LIST",
                        "needs perspective, orthographic or pinhole, got " + type.dump());
  }
  camera.type = CameraType::pinhole;
  if (auto ok = reader.only(
          {"name", "type", "matrix", "fx", "fy", "cx", "cy", "width", "height", "znear", "zfar"});
      !ok)
    return ok;
  const double lowest = -1e9;  // a principal point may lie outside of the image
  if (auto ok = reader.number("fx", true, 0.0, false, &camera.fx); !ok) return ok;
  if (auto ok = reader.number("fy", true, 0.0, false, &camera.fy); !ok) return ok;
  if (auto ok = reader.number("cx", true, lowest, true, &camera.cx); !ok) return ok;
  if (auto ok = reader.number("cy", true, lowest, true, &camera.cy); !ok) return ok;
  if (reader.has("width") != reader.has("height")) {
    return reader.error("", "UNDEFINED_PROPERTY", "needs both \"width\" and \"height\" or neither");
  }
  if (auto ok = reader.number("width", false, 0.0, false, &camera.width); !ok) return ok;
  return reader.number("height", false, 0.0, false, &camera.height);
}

util::Result<json> parse(const std::string& path, const util::Limits& limits) {
  const auto failed = [&](util::Exit exit, std::string code, std::string message) {
    return util::Error{exit, std::move(code), std::move(message), path, ""};
  };
  std::ifstream stream(path, std::ios::binary);  // a pipe serves as well
  if (!stream) return failed(util::Exit::io, "IO_ERROR", "cannot be opened");
  std::string text;
  while (stream && text.size() <= limits.max_json_bytes) {
    const std::size_t before = text.size();
    text.resize(before + kChunk);
    stream.read(text.data() + before, kChunk);
    text.resize(before + static_cast<std::size_t>(stream.gcount()));
  }
  if (stream.bad()) return failed(util::Exit::io, "IO_ERROR", "cannot be read");
  if (text.size() > limits.max_json_bytes) {
    return failed(
        util::Exit::limit, "",
        fmt::format("is longer than the {} bytes that are read of cameras", limits.max_json_bytes));
  }
  gltf::Issues issues(path);
  json root = gltf::parse_json(text, limits, issues);
  if (issues.failed()) return issues.take_error();
  return root;
}

util::Result<Camera> read_camera(const Reader& reader, const std::string& name) {
  if (!reader.object().is_object()) {
    return reader.error("", "TYPE_MISMATCH", "needs a JSON object");
  }
  Camera camera;
  camera.name = name;
  if (const auto given = reader.object().find("name"); given != reader.object().end()) {
    if (!given->is_string()) {
      return reader.error("/name", "TYPE_MISMATCH", "needs a string, got " + given->dump());
    }
    camera.name = given->get<std::string>();
  }
  if (auto ok = read_lens(reader, camera); !ok) return ok.error();
  const auto matrix = read_matrix(reader);
  if (!matrix) return matrix.error();
  camera.matrix = *matrix;
  if (auto ok = reader.number("znear", false, 0.0, true, &camera.znear); !ok) return ok.error();
  if (auto ok = reader.number("zfar", false, 0.0, false, &camera.zfar); !ok) return ok.error();
  if (!(camera.znear < camera.zfar)) {
    return reader.error(
        "/zfar", "CAMERA_ZFAR_LEQUAL_ZNEAR",
        fmt::format("needs more than znear, {}; got {}", camera.znear, camera.zfar));
  }
  return camera;
}

}  // namespace

util::Result<Camera> read_camera_file(const std::string& path) {
  util::Limits limits;
  limits.max_json_bytes = kMaxBytes;
  auto parsed = parse(path, limits);
  if (!parsed) return parsed.error();
  return read_camera(Reader(path, "", std::move(*parsed)), path);
}

util::Result<std::vector<Camera>> read_camera_path(const std::string& path,
                                                   const util::Limits& limits) {
  auto parsed = parse(path, limits);
  if (!parsed) return parsed.error();
  const std::string name = std::filesystem::path(path).stem().string();
  const auto list = parsed->find("cameras");
  if (list == parsed->end()) {
    auto camera = read_camera(Reader(path, "", std::move(*parsed)), name);
    if (!camera) return camera.error();
    return std::vector<Camera>{std::move(*camera)};
  }
  const Reader reader(path, "", *parsed);
  if (auto ok = reader.only({"cameras"}); !ok) return ok.error();
  if (!list->is_array() || list->empty()) {
    return reader.error("/cameras", "TYPE_MISMATCH", "needs an array that is not empty");
  }
  std::vector<Camera> cameras;
  for (std::size_t i = 0; i < list->size(); ++i) {
    auto camera = read_camera(Reader(path, fmt::format("/cameras/{}", i), (*list)[i]),
                              fmt::format("{}_{:03}", name, i));
    if (!camera) return camera.error();
    cameras.push_back(std::move(*camera));
  }
  return cameras;
}

}  // namespace octrace::scene
