#include "backend/scene/builtin.h"

#include <fmt/format.h>

#include <charconv>
#include <optional>

namespace octrace::scene {

namespace {

constexpr std::uint32_t kTerrainQuads = 1024;
constexpr std::uint32_t kSoupTriangles = 1'000'000;
constexpr std::uint32_t kMostTerrainQuads = 32'767;  // 2 * n * n triangles stay below 2^31
constexpr std::uint32_t kMostSoupTriangles = 1'000'000'000;

util::Error usage(std::string message) {
  return {util::Exit::usage, "", std::move(message), "", ""};
}

util::Result<std::uint32_t> parse_size(std::string_view name, std::optional<std::string_view> size,
                                       std::uint32_t standard, std::uint32_t most) {
  if (!size) return standard;
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(size->data(), size->data() + size->size(), value);
  if (error != std::errc() || end != size->data() + size->size() || value < 1 || value > most) {
    return usage(
        fmt::format("builtin:{} takes a size from 1 to {}, as in builtin:{}:{}; got \"{}\"", name,
                    most, name, standard, *size));
  }
  return value;
}

// Positions, triangles and their geometry: all that grows with the size.
util::Result<void> check(std::uint64_t triangles, std::uint64_t vertices,
                         const util::Limits& limits) {
  if (triangles > limits.max_triangles) {
    return util::Error{util::Exit::limit, "",
                       fmt::format("needs {} triangles, --max-triangles allows {}", triangles,
                                   limits.max_triangles),
                       "", ""};
  }
  const std::uint64_t bytes = triangles * (sizeof(kernels::Triangle) + sizeof(std::uint32_t)) +
                              vertices * sizeof(kernels::Vec3);
  if (bytes > limits.max_scene_bytes) {
    return util::Error{
        util::Exit::limit, "",
        fmt::format("needs {} bytes, --max-scene-bytes allows {}", bytes, limits.max_scene_bytes),
        "", ""};
  }
  return {};
}

}  // namespace

std::vector<std::string> builtin_names() { return {"default", "paper", "terrain", "soup"}; }

util::Result<Scene> make_builtin(std::string_view name, const util::Limits& limits) {
  const auto colon = name.find(':');
  const std::string_view base = name.substr(0, colon);
  const auto size = colon == std::string_view::npos
                        ? std::nullopt
                        : std::optional<std::string_view>(name.substr(colon + 1));
  if (base == "terrain") {
    const auto n = parse_size(base, size, kTerrainQuads, kMostTerrainQuads);
    if (!n) return n.error();
    const std::uint64_t quads = std::uint64_t{*n} * *n;
    if (auto ok = check(2 * quads, quads + 2 * std::uint64_t{*n} + 1, limits); !ok) {
      return ok.error();
    }
    return make_terrain_scene(*n);
  }
  if (base == "soup") {
    const auto n = parse_size(base, size, kSoupTriangles, kMostSoupTriangles);
    if (!n) return n.error();
    if (auto ok = check(*n, 3 * std::uint64_t{*n}, limits); !ok) return ok.error();
    return make_soup_scene(*n);
  }
  if (base == "default" || base == "paper") {
    if (size) return usage(fmt::format("builtin:{} takes no size", base));
    return base == "default" ? make_default_scene() : make_paper_scene();
  }
  return usage(fmt::format("there is no builtin:{}; there are builtin:{}", name,
                           fmt::join(builtin_names(), ", builtin:")));
}

}  // namespace octrace::scene
