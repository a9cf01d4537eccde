#include "backend/batch/view_record.h"

#include <algorithm>
#include <map>
#include <set>

#include "backend/scene/instances.h"

namespace octrace::batch {

using nlohmann::ordered_json;

ordered_json objects_record(std::span<const ViewObject> objects) {
  ordered_json list = ordered_json::array();
  for (const ViewObject& object : objects) {
    ordered_json entry = {{"id", object.id},
                          {"pixels", object.pixels},
                          {"box", {object.left, object.top, object.right, object.bottom}}};
    if (!object.rle.empty()) entry["rle"] = object.rle;
    list.push_back(std::move(entry));
  }
  return list;
}

ordered_json scene_objects_record(const scene::Scene& scene) {
  std::map<std::uint32_t, std::set<std::uint32_t>> materials;  // by object
  for (const kernels::Geometry& geometry : scene.geometries) {
    materials[geometry.object].insert(geometry.material);
  }
  if (scene.instancing) {
    const scene::Instancing& instancing = *scene.instancing;
    for (const kernels::Instance& instance : instancing.instances) {
      const scene::MeshRange& range = instancing.ranges[instance.mesh];
      for (std::uint32_t g = 0; g < range.geometry_count; ++g) {
        const auto& geometry = instancing.meshes->geometries[range.first_geometry + g];
        materials[instance.object].insert(geometry.material);
      }
    }
  }
  const auto name = [](const std::vector<std::string>& names, std::uint32_t index) {
    return index < names.size() ? names[index] : std::string();
  };
  ordered_json list = ordered_json::array();
  for (const auto& [object, used] : materials) {
    ordered_json names = ordered_json::array();
    for (const std::uint32_t material : used) {
      names.push_back(name(scene.material_names, material));
    }
    const std::string mesh = name(scene.object_meshes, object);
    list.push_back({{"id", object + 1},
                    {"name", name(scene.object_names, object)},
                    {"mesh", mesh.empty() ? name(scene.object_names, object) : mesh},
                    {"materials", std::move(names)}});
  }
  return list;
}

util::Result<scene::Camera> camera_of_record(const ordered_json& lens) {
  try {
    scene::Camera camera;
    const std::string type = lens.at("type");
    if (type == "pinhole") {
      camera.type = scene::CameraType::pinhole;
      camera.fx = lens.at("fx");
      camera.fy = lens.at("fy");
      camera.cx = lens.at("cx");
      camera.cy = lens.at("cy");
      camera.width = lens.value("width", 0.0);
      camera.height = lens.value("height", 0.0);
    } else if (type == "orthographic") {
      camera.type = scene::CameraType::orthographic;
      camera.xmag = lens.at("xmag");
      camera.ymag = lens.at("ymag");
    } else {
      camera.yfov = lens.at("yfov");
    }
    const ordered_json& matrix = lens.at("matrix");
    for (int i = 0; i < 16; ++i) camera.matrix[i / 4][i % 4] = matrix.at(i);
    camera.znear = lens.value("znear", camera.znear);
    camera.zfar = lens.value("zfar", camera.zfar);
    return camera;
  } catch (const ordered_json::exception& exception) {
    return util::Error{util::Exit::invalid_input, "INVALID_LENS", exception.what(), "", "/lens"};
  }
}

}  // namespace octrace::batch
