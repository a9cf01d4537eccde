// Small scenes put together by hand, for tests of what exporters write.
#pragma once

#include <string>
#include <vector>

#include "backend/scene/scene.h"

namespace octrace::test {

struct Part {
  std::string name;
  std::uint32_t material = 0;
  std::vector<kernels::Vec3> positions;
  std::vector<kernels::Triangle> triangles;
  std::vector<kernels::Vec2> uvs = {};
  std::vector<kernels::Vec3> normals = {};
  std::vector<kernels::Vec4> colors = {};
};

// One object a part.
void add_part(scene::Scene& scene, const Part& part);
std::uint32_t add_material(scene::Scene& scene, const kernels::Material& material,
                           const std::string& name = "");
std::uint32_t add_texture(scene::Scene& scene, std::uint32_t width, std::uint32_t height,
                          const std::vector<std::uint32_t>& texels, kernels::Wrap wrap_s,
                          kernels::Wrap wrap_t, kernels::Filter filter);
void finish(scene::Scene& scene);  // bounds

Part sphere(const std::string& name, const kernels::Vec3& centre, float radius, int around = 24,
            int rings = 12);
Part box(const std::string& name, const kernels::Vec3& centre, const kernels::Vec3& half);
// A rectangle that faces +Z, counter-clockwise; uv (0, 0) at its top left corner.
Part card(const std::string& name, const kernels::Vec3& centre, float half_x, float half_y,
          float uv_scale = 1.0f);
void flip(Part& part);  // the other way round

scene::Camera look_at(const glm::dvec3& eye, const glm::dvec3& target, double yfov);

// Spheres and boxes, single- and double-sided, coincident sheets, slivers and points, cut-out
// cards.
scene::Scene varied_scene();

// A folder of the test's own, removed with what is in it.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::string file(const std::string& name) const { return path_ + "/" + name; }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

std::string read_text(const std::string& path);

}  // namespace octrace::test
