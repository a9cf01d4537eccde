#include <algorithm>
#include <cctype>

#include "backend/render/framebuffer.h"

namespace octrace::render {

namespace {

constexpr std::array<AovInfo, kernels::kAovCount> kTable = {{
    {Aov::beauty,
     "beauty",
     "RGBA",
     {"R", "G", "B", "A"},
     4,
     false,
     "shaded colour, linear, premultiplied by A"},
    {Aov::depth, "depth", "Z", {"Z"}, 1, false, "planar depth along the camera's axis, metres"},
    {Aov::distance,
     "distance",
     "distance",
     {"distance"},
     1,
     false,
     "Euclidean distance from the camera, metres"},
    {Aov::normal,
     "normal",
     "N",
     {"N.X", "N.Y", "N.Z"},
     3,
     false,
     "shading normal with normal texture, world, facing the viewer"},
    {Aov::geometric_normal,
     "geometric_normal",
     "Ng",
     {"Ng.X", "Ng.Y", "Ng.Z"},
     3,
     false,
     "normal of the flat triangle, world, facing the viewer"},
    {Aov::position, "position", "P", {"P.X", "P.Y", "P.Z"}, 3, false, "world position, metres"},
    {Aov::albedo,
     "albedo",
     "albedo",
     {"albedo.R", "albedo.G", "albedo.B"},
     3,
     false,
     "base colour, linear"},
    {Aov::uv, "uv", "uv", {"uv.X", "uv.Y"}, 2, false, "first texture coordinate set"},
    {Aov::barycentric,
     "barycentric",
     "bary",
     {"bary.X", "bary.Y"},
     2,
     false,
     "weights of the triangle's second and third corner"},
    {Aov::object_id, "object_id", "object", {"object_id"}, 1, true, "glTF node index + 1"},
    {Aov::material_id, "material_id", "material", {"material_id"}, 1, true, "material index + 1"},
    {Aov::primitive_id,
     "primitive_id",
     "primitive",
     {"primitive_id"},
     1,
     true,
     "triangle index + 1"},
    {Aov::mask, "mask", "silhouette", {"mask"}, 1, false, "1 where something is hit"},
    {Aov::motion,
     "motion",
     "motion",
     {"motion.X", "motion.Y"},
     2,
     false,
     "to the next frame, pixels, +X right, +Y down"},
}};

bool equal_ignoring_case(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](unsigned char x, unsigned char y) {
    return std::tolower(x) == std::tolower(y);
  });
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return text;
}

}  // namespace

std::span<const AovInfo> aov_table() { return kTable; }

const AovInfo& aov_info(Aov aov) { return kTable[static_cast<std::size_t>(aov)]; }

std::string aov_names() {
  std::string names;
  for (const AovInfo& info : kTable) {
    if (!names.empty()) names += ", ";
    names += info.option;
    if (info.alias != info.option) names.append(" (").append(info.alias).append(")");
  }
  return names;
}

util::Result<AovSet> parse_aovs(std::string_view list) {
  AovSet set;
  for (;;) {
    const std::size_t comma = list.find(',');
    const std::string_view name = trimmed(list.substr(0, comma));
    const auto* found = std::find_if(kTable.begin(), kTable.end(), [&](const AovInfo& info) {
      return equal_ignoring_case(name, info.option) || equal_ignoring_case(name, info.alias);
    });
    if (equal_ignoring_case(name, "all")) {
      set.set();
    } else if (found != kTable.end()) {
      set.set(static_cast<std::size_t>(found->aov));
    } else {
      return util::Error{
          util::Exit::usage, "",
          "--aov: there is no '" + std::string(name) + "'; there are: all, " + aov_names(), "", ""};
    }
    if (comma == std::string_view::npos) return set;
    list.remove_prefix(comma + 1);
  }
}

}  // namespace octrace::render
