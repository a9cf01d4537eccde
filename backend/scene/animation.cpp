#include "backend/scene/animation.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <set>

#include "backend/gltf/accessor.h"
#include "backend/scene/names.h"

namespace octrace::scene {

namespace {

util::Error no_such_animation(const gltf::Document& document, const std::string& choice) {
  const auto& animations = document.model.animations;
  std::string there;
  for (std::size_t i = 0; i < animations.size() && i < 10; ++i) {
    there += fmt::format("{}{} \"{}\"", i > 0 ? ", " : "", i,
                         printable(name_of(animations, i, "animation")));
  }
  if (animations.size() > 10) there += ", ...";
  return {util::Exit::usage, "",
          fmt::format("--animation {}: there is no such animation; the file has {}", choice,
                      there.empty() ? "none" : there),
          document.file, ""};
}

Interpolation interpolation_of(const tinygltf::AnimationSampler& sampler) {
  if (sampler.interpolation == "STEP") return Interpolation::step;
  return sampler.interpolation == "CUBICSPLINE" ? Interpolation::cubic_spline
                                                : Interpolation::linear;
}

}  // namespace

util::Result<std::optional<int>> choose_animation(const gltf::Document& document,
                                                  const std::string& choice) {
  const auto& animations = document.model.animations;
  if (choice == "none") return std::optional<int>();
  if (choice.empty()) return animations.empty() ? std::optional<int>() : std::optional<int>(0);
  for (std::size_t i = 0; i < animations.size(); ++i) {
    if (animations[i].name == choice) return std::optional<int>(static_cast<int>(i));
  }
  std::size_t index = 0;
  const char* end = choice.data() + choice.size();
  const auto [stop, error] = std::from_chars(choice.data(), end, index);
  if (error != std::errc() || stop != end || index >= animations.size()) {
    return no_such_animation(document, choice);
  }
  return std::optional<int>(static_cast<int>(index));
}

util::Result<Animation> Animation::read(const gltf::Document& document, int index) {
  const tinygltf::Model& model = document.model;
  const tinygltf::Animation& source = model.animations[static_cast<std::size_t>(index)];
  Animation animation;
  std::map<int, std::size_t> known;  // many channels may share one long sampler
  for (std::size_t c = 0; c < source.channels.size(); ++c) {
    const tinygltf::AnimationChannel& channel = source.channels[c];
    if (channel.target_node < 0) continue;  // an extension's own target
    Path path = Path::translation;
    std::size_t width = 3;
    if (channel.target_path == "rotation") {
      path = Path::rotation;
      width = 4;
    } else if (channel.target_path == "scale") {
      path = Path::scale;
    } else if (channel.target_path == "weights") {
      const tinygltf::Node& node = model.nodes[static_cast<std::size_t>(channel.target_node)];
      path = Path::weights;
      width = model.meshes[static_cast<std::size_t>(node.mesh)].primitives[0].targets.size();
    } else if (channel.target_path != "translation") {
      continue;
    }
    const auto [entry, added] = known.try_emplace(channel.sampler, animation.samplers_.size());
    if (added) {
      const auto& sampler = source.samplers[static_cast<std::size_t>(channel.sampler)];
      std::vector<float> keys = document.read_floats(sampler.input);
      std::vector<float> values = document.read_floats(sampler.output);
      const Interpolation interpolation = interpolation_of(sampler);
      const std::size_t per_key = (interpolation == Interpolation::cubic_spline ? 3 : 1) * width;
      if (keys.empty() || values.size() / keys.size() != per_key ||
          values.size() % keys.size() != 0) {
        return util::Error{
            util::Exit::invalid_input, "ANIMATION_SAMPLER_OUTPUT_ACCESSOR_INVALID_COUNT",
            fmt::format("needs {} numbers for each of {} keys, there are {}", per_key, keys.size(),
                        values.size()),
            document.file, fmt::format("/animations/{}/channels/{}/sampler", index, c)};
      }
      animation.samplers_.emplace_back(std::move(keys), std::move(values), interpolation);
    }
    if (animation.samplers_[entry->second].width() != width) {
      return util::Error{
          util::Exit::invalid_input, "ANIMATION_SAMPLER_OUTPUT_ACCESSOR_INVALID_FORMAT",
          fmt::format("needs {} numbers a key, there are {}", width,
                      animation.samplers_[entry->second].width()),
          document.file, fmt::format("/animations/{}/channels/{}/sampler", index, c)};
    }
    animation.channels_.push_back({channel.target_node, path, entry->second});
  }
  return animation;
}

void Animation::apply(double seconds, Pose& pose) const {
  for (const Channel& channel : channels_) {
    const Sampler& sampler = samplers_[channel.sampler];
    const auto node = static_cast<std::size_t>(channel.node);
    LocalTransform& local = pose.nodes[node];
    switch (channel.path) {
      case Path::translation:
        sampler.evaluate(seconds, {&local.translation.x, 3});
        break;
      case Path::rotation:
        local.rotation = sampler.evaluate_rotation(seconds);
        break;
      case Path::scale:
        sampler.evaluate(seconds, {&local.scale.x, 3});
        break;
      case Path::weights:
        sampler.evaluate(seconds, pose.weights[node]);
        break;
    }
  }
}

std::vector<double> Animation::shared_keys() const {
  std::set<double> keys;
  for (const Sampler& sampler : samplers_) {
    for (const float key : sampler.keys()) {
      const auto holds = [&](const Sampler& other) { return other.holds(double{key}); };
      if (std::all_of(samplers_.begin(), samplers_.end(), holds)) keys.insert(double{key});
    }
  }
  return {keys.begin(), keys.end()};
}

}  // namespace octrace::scene
