#include "tests/support/large_meshes.h"

#include <cmath>
#include <utility>

namespace octrace::tests {

using kernels::Vec3;

Mesh make_mesh(const char* name, std::uint32_t count, const Corner& corner) {
  Mesh mesh{name, {}, {}};
  std::mt19937_64 random(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (int c = 0; c < 3; ++c) mesh.positions.push_back(corner(i, c, random));
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

float uniform(std::mt19937_64& random) { return static_cast<float>(random() >> 40) * 0x1p-24f; }

Mesh make_dust(std::uint32_t count, float scale) {
  Vec3 centre;
  return make_mesh("dust", count, [&](std::uint32_t, int c, std::mt19937_64& random) {
    const Vec3 v(uniform(random), uniform(random), uniform(random));
    if (c == 0) centre = v;
    return scale * (centre + 0.01f * v);
  });
}

Mesh make_disc_in_dust(std::uint32_t sectors) {
  const float step = 6.2831853f / static_cast<float>(sectors);
  return make_mesh("disc_in_dust", sectors + 20000,
                   [=, centre = Vec3()](std::uint32_t i, int c, std::mt19937_64& r) mutable {
                     if (i < sectors) {
                       if (c == 0) return Vec3(0.5f);
                       const float at =
                           step * static_cast<float>(i + static_cast<std::uint32_t>(c));
                       return Vec3(0.5f + 0.4f * std::cos(at), 0.5f + 0.4f * std::sin(at), 0.5f);
                     }
                     const Vec3 v(uniform(r), uniform(r), uniform(r));
                     if (c == 0) centre = v;
                     return centre + 0.01f * v;
                   });
}

std::vector<LargeMesh> large_meshes() {
  std::vector<LargeMesh> meshes;
  for (const std::uint32_t count : {64u, 65u, 1024u, 1025u, 8192u, 65535u, 65536u, 262145u}) {
    std::string name = "dust_";
    name += std::to_string(count);  // GCC 12 warns of a sum of the two
    meshes.push_back({std::move(name), [count] { return make_dust(count); }});
  }
  const auto add = [&](const char* name, std::uint32_t count, const Corner& corner) {
    meshes.push_back({name, [=] { return make_mesh(name, count, corner); }});
  };
  add("one_place", 8193,
      [](std::uint32_t, int c, std::mt19937_64&) { return Vec3(c == 0, c == 1, c == 2); });
  add("one_point", 20000,
      [](std::uint32_t, int, std::mt19937_64&) { return Vec3(3.0f, -2.0f, 1.0f); });
  add("long_slivers", 20000, [](std::uint32_t i, int c, std::mt19937_64& random) {
    const float y = static_cast<float>(i) * 1e-4f;
    return c == 0   ? Vec3(-100.0f, y, 0.0f)
           : c == 1 ? Vec3(100.0f, y, uniform(random))
                    : Vec3(100.0f, y + 1e-6f, 0.0f);
  });
  add("one_huge_among_many", 20000, [](std::uint32_t i, int c, std::mt19937_64& r) {
    if (i == 7777) return Vec3(c == 0 ? 1e4f : -1.0f, c == 1 ? 1e4f : -1.0f, c == 2 ? 1e4f : -1.0f);
    return Vec3(uniform(r), uniform(r), uniform(r)) * 0.01f + Vec3(static_cast<float>(i % 141));
  });
  meshes.push_back({"denormals", [] { return make_dust(20000, 1e-42f); }});
  meshes.push_back({"far", [] { return make_dust(20000, 9e8f); }});
  // A floor, a wall and a beam among dust: large triangles that are cut.
  add("room", 30000, [centre = Vec3()](std::uint32_t i, int c, std::mt19937_64& r) mutable {
    if (i < 300) {
      const float at = static_cast<float>(i / 6) / 50.0f;
      const bool far = (i + static_cast<std::uint32_t>(c)) % 2 != 0;
      if (i % 3 == 0) return Vec3(c == 0 ? 0.0f : 1.0f, at, far ? 1.0f : 0.0f);
      if (i % 3 == 1) return Vec3(at, c == 1 ? 0.0f : 1.0f, far ? 1.0f : 0.0f);
      return Vec3(c == 2 ? 1.0f : 0.0f, far ? 1.0f : 0.0f, c == 1 ? 1.0f : at);
    }
    const Vec3 v(uniform(r), uniform(r), uniform(r));
    if (c == 0) centre = v;
    return centre + 0.01f * v;
  });
  // Large triangles alone, of which re-insertion moves many.
  add("clutter", 9000, [centre = Vec3()](std::uint32_t, int c, std::mt19937_64& r) mutable {
    const Vec3 v(uniform(r), uniform(r), uniform(r));
    if (c == 0) centre = v;
    return centre + 0.5f * v;
  });
  meshes.push_back({"disc_in_dust", [] { return make_disc_in_dust(4096); }});
  // Ever smaller triangles about one corner: the deepest trees, from which halving by rank saves.
  add("chain", 20000, [](std::uint32_t i, int c, std::mt19937_64&) {
    const float s = std::exp2(-0.007f * static_cast<float>(i));
    return Vec3(c == 0 ? s : 0.0f, c == 1 ? s : 0.0f, c == 2 ? s : 0.0f);
  });
  return meshes;
}

}  // namespace octrace::tests
