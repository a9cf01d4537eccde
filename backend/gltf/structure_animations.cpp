#include <fmt/format.h>

#include <array>
#include <map>

#include "backend/gltf/structure.h"

namespace octrace::gltf {
namespace {

constexpr std::array<std::string_view, 3> kInterpolations{"LINEAR", "STEP", "CUBICSPLINE"};
constexpr std::array<std::string_view, 4> kPaths{"translation", "rotation", "scale", "weights"};

void check_target(const JsonRef& root, const JsonRef& channel, const Sizes& sizes) {
  const JsonRef target = channel.required("target").as_object();
  if (!target) return;
  check_common(target);
  const JsonRef node_ref = target.member("node");
  const int node = node_ref.as_index(sizes.nodes, "node");
  const JsonRef path_ref = target.required("path");
  if (!node_ref) {
    // Left to an extension; glTF says to ignore the channel then.
    (void)path_ref.as_string();
    return;
  }
  const auto path = path_ref.as_one_of(kPaths);
  if (!path || node < 0) return;
  const Json& object = root.json()["nodes"][static_cast<std::size_t>(node)];
  if (*path != "weights" && object.contains("matrix")) {
    target.invalid("ANIMATION_CHANNEL_TARGET_NODE_MATRIX",
                   fmt::format("node {} has a matrix, which cannot be animated", node));
  }
  if (*path == "weights") {
    bool morphs = false;
    if (object.contains("mesh")) {
      const auto mesh = object["mesh"].get<std::size_t>();  // an index that check_nodes has passed
      morphs = root.json()["meshes"][mesh]["primitives"][0].contains("targets");
    }
    if (!morphs) {
      target.invalid("ANIMATION_CHANNEL_TARGET_NODE_WEIGHTS_NO_MORPHS",
                     fmt::format("node {} has no morph targets", node));
    }
  }
}

}  // namespace

void check_animations(const JsonRef& root, const Sizes& sizes) {
  if (root.issues().failed()) return;
  each_object(root, "animations", [&](const JsonRef& animation) {
    check_common(animation);
    const JsonRef samplers = animation.required("samplers").as_array();
    samplers.each_element([&](std::size_t, const JsonRef& element) {
      const JsonRef sampler = element.as_object();
      if (!sampler) return;
      check_common(sampler);
      (void)sampler.required("input").as_index(sizes.accessors, "accessor");
      (void)sampler.required("output").as_index(sizes.accessors, "accessor");
      (void)sampler.member("interpolation").as_one_of(kInterpolations);
    });
    const JsonRef channels = animation.required("channels").as_array();
    if (!samplers || !channels) return;
    std::map<std::pair<int, std::string_view>, std::size_t> targets;
    channels.each_element([&](std::size_t i, const JsonRef& element) {
      const JsonRef channel = element.as_object();
      if (!channel) return;
      check_common(channel);
      (void)channel.required("sampler").as_index(samplers.json().size(), "sampler");
      check_target(root, channel, sizes);
      if (channel.issues().failed()) return;
      const JsonRef target = channel.member("target");
      const JsonRef node_ref = target.member("node");
      if (!node_ref) return;
      const std::pair key{node_ref.as_index(sizes.nodes, "node"),
                          target.member("path").as_string().value_or("")};
      const auto [other, is_new] = targets.emplace(key, i);
      if (!is_new) {
        const JsonRef first = channels.element(other->second);
        first.member("target").invalid("ANIMATION_DUPLICATE_TARGETS",
                                       fmt::format("channel {} has the same target", i));
      }
    });
  });
}

}  // namespace octrace::gltf
