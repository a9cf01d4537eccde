#include "backend/batch/cameras_file.h"

#include <cmath>

#include "backend/batch/view_record.h"
#include "backend/scene/projection.h"
#include "backend/util/version.h"

namespace octrace::batch {

using nlohmann::ordered_json;

namespace {

ordered_json rows(const glm::dmat4& matrix) {
  ordered_json list = ordered_json::array();
  for (int row = 0; row < 4; ++row) {
    ordered_json line = ordered_json::array();
    // 0.0 in place of -0.0, which an inverse brings about
    for (int column = 0; column < 4; ++column) line.push_back(matrix[column][row] + 0.0);
    list.push_back(std::move(line));
  }
  return list;
}

ordered_json pose(const glm::dmat4& camera_to_world) {
  return {{"camera_to_world", rows(camera_to_world)},
          {"world_to_camera", rows(scene::rigid_inverse(camera_to_world))}};
}

ordered_json conventions() {
  return {
      {"units", "metres, pixels"},
      {"world", "glTF: right-handed, +Y up"},
      {"matrices", "4 rows of 4, for column vectors: camera = world_to_camera * world"},
      {"opengl",
       "camera axes X right, Y up, Z backward, as in OpenGL, glTF, Blender and nerfstudio"},
      {"opencv", "camera axes X right, Y down, Z forward, as in OpenCV and COLMAP"},
      {"intrinsics",
       "of the opencv axes: perspective x = cx + fx X / Z, y = cy + fy Y / Z; orthographic "
       "x = cx + fx X, y = cy + fy Y, fx and fy in pixels a metre; Z is the plane Z of the images"},
      {"pixels",
       "x and y from the image's top left corner: the centre of the first pixel is (0.5, 0.5), as "
       "in "
       "COLMAP and OpenGL; for functions that put it at (0, 0), as OpenCV's, subtract 0.5 from cx, "
       "cy"}};
}

}  // namespace

util::Result<ordered_json> camera_entry(const ordered_json& view_line) {
  try {
    const util::Result<scene::Camera> camera = camera_of_record(view_line.at("lens"));
    if (!camera) return camera.error();
    const int width = view_line.at("size").at(0), height = view_line.at("size").at(1);
    const scene::Projection projection = scene::make_projection(*camera, width, height);
    ordered_json entry;
    entry["view"] = view_line.at("view");
    entry["scene"] = view_line.at("name");
    entry["camera"] = view_line.at("camera");
    entry["frame"] = view_line.at("frame");
    if (view_line.contains("time")) entry["time"] = view_line["time"];
    entry["files"] = ordered_json::array();
    for (const ordered_json& file : view_line.at("files")) {
      entry["files"].push_back(file.at("path"));
    }
    entry["width"] = width;
    entry["height"] = height;
    entry["type"] = projection.orthographic ? "orthographic" : "perspective";
    entry["fx"] = projection.fx;
    entry["fy"] = projection.fy;
    entry["cx"] = projection.cx;
    entry["cy"] = projection.cy;
    entry["znear"] = camera->znear;
    if (std::isfinite(camera->zfar)) entry["zfar"] = camera->zfar;
    entry["opengl"] = pose(projection.opengl_to_world);
    entry["opencv"] = pose(projection.opencv_to_world);
    return entry;
  } catch (const ordered_json::exception& exception) {
    return util::Error{util::Exit::invalid_input, "INVALID_RECORD", exception.what(), "", ""};
  }
}

util::Result<CamerasFile> CamerasFile::create(const std::string& path) {
  util::Result<JsonListFile> file = JsonListFile::create(
      path, {{"octrace", util::version()}, {"conventions", conventions()}}, "views");
  if (!file) return file.error();
  return CamerasFile(std::move(*file));
}

util::Result<void> CamerasFile::add(const ordered_json& view_line) {
  util::Result<ordered_json> entry = camera_entry(view_line);
  if (!entry) return entry.error();
  return file_.add(*entry);
}

}  // namespace octrace::batch
