#include "backend/gltf/structure.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <set>
#include <string>

#include "backend/gltf/extensions.h"

namespace octrace::gltf {
namespace {

// Also checks that the array, where it is there, is a non-empty array of objects.
std::size_t array_size(const JsonRef& parent, std::string_view key) {
  const JsonRef array = parent.member(key);
  const JsonRef checked = array.as_array();
  if (!checked) return 0;
  const std::size_t size = checked.json().size();
  checked.each_element([](std::size_t, const JsonRef& element) { (void)element.as_object(); });
  return size;
}

struct Version {
  int major = 0, minor = 0;
};

std::optional<Version> parse_version(std::string_view text) {
  Version version;
  const char* end = text.data() + text.size();
  const auto major = std::from_chars(text.data(), end, version.major);
  if (major.ec != std::errc() || major.ptr == end || *major.ptr != '.') return std::nullopt;
  const auto minor = std::from_chars(major.ptr + 1, end, version.minor);
  if (minor.ec != std::errc() || minor.ptr != end) return std::nullopt;
  return version;
}

// Members of these arrays must be unique strings (JSON schema: uniqueItems).
std::set<std::string_view> check_names(const JsonRef& list) {
  std::set<std::string_view> names;
  list.as_array().each_element([&](std::size_t, const JsonRef& element) {
    const auto name = element.as_string();
    if (name && !names.insert(*name).second) {
      element.invalid("DUPLICATE_ELEMENTS", fmt::format("{} is listed twice", quote(*name)));
    }
  });
  return names;
}

}  // namespace

void check_common(const JsonRef& object) {
  (void)object.member("name").as_string();
  const JsonRef extensions = object.member("extensions");
  extensions.as_object().each_member(
      [](std::string_view, const JsonRef& extension) { (void)extension.as_object(); });
}

void check_asset(const JsonRef& root) {
  const JsonRef asset = root.required("asset").as_object();
  if (!asset) return;
  check_common(asset);
  for (const auto* key : {"generator", "copyright"}) (void)asset.member(key).as_string();
  const auto read = [&](const JsonRef& ref) -> std::optional<Version> {
    const auto text = ref.as_string();
    if (!text) return std::nullopt;
    const auto version = parse_version(*text);
    if (!version) {
      ref.invalid("PATTERN_MISMATCH", fmt::format("needs MAJOR.MINOR, has {}", quote(*text)));
    }
    return version;
  };
  const JsonRef version_ref = asset.required("version");
  const JsonRef minimum_ref = asset.member("minVersion");
  const auto version = read(version_ref);
  const auto minimum = read(minimum_ref);
  if (!version) return;
  if (version->major != 2) {
    root.issues().fail(
        util::Exit::unsupported, "UNKNOWN_ASSET_MAJOR_VERSION", version_ref.pointer(),
        fmt::format("octrace reads glTF 2.0, the file is {}.{}", version->major, version->minor));
  } else if (minimum && (minimum->major != version->major || minimum->minor > version->minor)) {
    minimum_ref.invalid("ASSET_MIN_VERSION_GREATER_THAN_VERSION",
                        fmt::format("{}.{} is above the version {}.{}", minimum->major,
                                    minimum->minor, version->major, version->minor));
  } else if (minimum && minimum->minor > 0) {
    root.issues().fail(util::Exit::unsupported, "UNKNOWN_ASSET_MINOR_VERSION",
                       minimum_ref.pointer(),
                       fmt::format("octrace reads glTF 2.0, the file needs 2.{}", minimum->minor));
  } else if (version->minor > 0) {
    root.issues().warn("UNKNOWN_ASSET_MINOR_VERSION", version_ref.pointer(),
                       fmt::format("2.{} is read as 2.0", version->minor));
  }
}

void check_extension_lists(const JsonRef& root) {
  const JsonRef used = root.member("extensionsUsed");
  const JsonRef required = root.member("extensionsRequired");
  const auto used_names = check_names(used);
  const auto required_names = check_names(required);
  if (root.issues().failed()) return;
  required.each_element([&](std::size_t, const JsonRef& element) {
    const auto name = *element.as_string();
    if (extension_support(name) == Support::unknown) {
      root.issues().fail(
          util::Exit::unsupported, "UNSUPPORTED_EXTENSION", element.pointer(),
          fmt::format("the file requires {}, which octrace does not have", quote(name)));
    } else if (!used_names.contains(name)) {
      element.invalid("UNSATISFIED_DEPENDENCY",
                      fmt::format("{} is required but not in extensionsUsed", quote(name)));
    }
  });
  used.each_element([&](std::size_t, const JsonRef& element) {
    const auto name = *element.as_string();
    if (extension_support(name) == Support::unknown) {
      root.issues().warn("UNSUPPORTED_EXTENSION", element.pointer(),
                         fmt::format("{} is ignored", quote(name)));
    } else if (extension_support(name) == Support::approximated) {
      root.issues().warn("UNSUPPORTED_EXTENSION", element.pointer(),
                         fmt::format("{} is approximated by glTF's core material", quote(name)));
    }
  });
}

void check_structure(const JsonRef& root, const util::Limits& limits) {
  check_common(root);
  check_asset(root);
  if (root.issues().failed()) return;
  check_extension_lists(root);
  if (root.issues().failed()) return;

  Sizes sizes;
  sizes.accessors = array_size(root, "accessors");
  sizes.animations = array_size(root, "animations");
  sizes.buffers = array_size(root, "buffers");
  sizes.buffer_views = array_size(root, "bufferViews");
  sizes.cameras = array_size(root, "cameras");
  sizes.images = array_size(root, "images");
  sizes.materials = array_size(root, "materials");
  sizes.meshes = array_size(root, "meshes");
  sizes.nodes = array_size(root, "nodes");
  sizes.samplers = array_size(root, "samplers");
  sizes.scenes = array_size(root, "scenes");
  sizes.skins = array_size(root, "skins");
  sizes.textures = array_size(root, "textures");
  const JsonRef extensions = root.member("extensions");
  const JsonRef punctual = extensions.member("KHR_lights_punctual");
  sizes.lights = array_size(punctual, "lights");
  const JsonRef variants = extensions.member("KHR_materials_variants");
  sizes.variants = array_size(variants, "variants");
  if (root.issues().failed()) return;
  if (sizes.nodes > limits.max_nodes) {
    root.issues().fail(
        util::Exit::limit, "LIMIT", "/nodes",
        fmt::format("the file has {} nodes, --max-nodes allows {}", sizes.nodes, limits.max_nodes));
    return;
  }

  check_buffers(root, sizes);
  check_accessors(root, sizes);
  check_images(root, sizes);
  check_materials(root, sizes);
  check_meshes(root, sizes);
  check_variants(root, sizes);
  check_compression(root, sizes);
  check_cameras(root);
  check_nodes(root, sizes);
  check_animations(root, sizes);
  (void)root.member("scene").as_index(sizes.scenes, "scene");
  if (!root.issues().failed()) check_hierarchy(root);
}

}  // namespace octrace::gltf
