// Skins and animations: formats and counts of their accessors.
#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "backend/gltf/accessor.h"
#include "backend/gltf/links.h"
#include "backend/util/checked.h"

namespace octrace::gltf {
namespace {

std::string name_of(const tinygltf::Accessor& accessor) {
  return format_name(accessor.type, accessor.componentType, accessor.normalized);
}

bool is_skinned(const tinygltf::Primitive& primitive) {
  return primitive.attributes.contains("JOINTS_0") && primitive.attributes.contains("WEIGHTS_0");
}

bool output_format_fits(const std::string& path, const tinygltf::Accessor& output) {
  const bool is_float = output.componentType == TINYGLTF_COMPONENT_TYPE_FLOAT;
  const bool is_normalised = output.normalized;  // only bytes and shorts can be
  if (path == "rotation") return output.type == TINYGLTF_TYPE_VEC4 && (is_float || is_normalised);
  if (path == "weights") return output.type == TINYGLTF_TYPE_SCALAR && (is_float || is_normalised);
  return output.type == TINYGLTF_TYPE_VEC3 && is_float;
}

void check_channel(const tinygltf::Model& model, const tinygltf::Animation& animation,
                   const tinygltf::AnimationChannel& channel, const std::string& pointer,
                   Issues& issues) {  // pointer: the channel's
  if (channel.target_node < 0) return;
  const auto& sampler = animation.samplers[static_cast<std::size_t>(channel.sampler)];
  const auto& input = model.accessors[static_cast<std::size_t>(sampler.input)];
  const auto& output = model.accessors[static_cast<std::size_t>(sampler.output)];
  if (!output_format_fits(channel.target_path, output)) {
    issues.invalid("ANIMATION_SAMPLER_OUTPUT_ACCESSOR_INVALID_FORMAT", pointer + "/sampler",
                   fmt::format("accessor {} is {}, which {} cannot be", sampler.output,
                               name_of(output), channel.target_path));
    return;
  }
  std::uint64_t per_key = sampler.interpolation == "CUBICSPLINE" ? 3 : 1;
  if (channel.target_path == "weights") {
    const auto& node = model.nodes[static_cast<std::size_t>(channel.target_node)];
    per_key *= model.meshes[static_cast<std::size_t>(node.mesh)].primitives[0].targets.size();
  }
  const auto needed = util::checked_mul(per_key, input.count);
  if (!needed || *needed != output.count) {
    issues.invalid("ANIMATION_SAMPLER_OUTPUT_ACCESSOR_INVALID_COUNT", pointer + "/sampler",
                   fmt::format("needs {} elements ({} for each of {} keys), accessor {} has {}",
                               needed.value_or(UINT64_MAX), per_key, input.count, sampler.output,
                               output.count));
  }
}

}  // namespace

void check_skin_links(const tinygltf::Model& model, Issues& issues) {
  for (std::size_t i = 0; i < model.skins.size() && !issues.failed(); ++i) {
    const auto& skin = model.skins[i];
    if (skin.inverseBindMatrices < 0) continue;
    const auto& matrices = model.accessors[static_cast<std::size_t>(skin.inverseBindMatrices)];
    const std::string place = fmt::format("/skins/{}/inverseBindMatrices", i);
    if (matrices.type != TINYGLTF_TYPE_MAT4 ||
        matrices.componentType != TINYGLTF_COMPONENT_TYPE_FLOAT) {
      issues.invalid("SKIN_IBM_INVALID_FORMAT", place,
                     fmt::format("needs MAT4 of FLOAT, accessor {} is {}", skin.inverseBindMatrices,
                                 name_of(matrices)));
    } else if (matrices.count < skin.joints.size()) {
      issues.invalid("INVALID_IBM_ACCESSOR_COUNT", place,
                     fmt::format("needs {} matrices, accessor {} has {}", skin.joints.size(),
                                 skin.inverseBindMatrices, matrices.count));
    }
  }
  // Many nodes may share a mesh of many primitives, so each mesh is looked through once.
  std::vector<std::size_t> skinned(model.meshes.size());
  for (std::size_t i = 0; i < model.meshes.size(); ++i) {
    const auto& primitives = model.meshes[i].primitives;
    skinned[i] =
        static_cast<std::size_t>(std::count_if(primitives.begin(), primitives.end(), is_skinned));
  }
  for (std::size_t i = 0; i < model.nodes.size(); ++i) {
    const auto& node = model.nodes[i];
    if (node.mesh < 0) continue;
    const auto mesh = static_cast<std::size_t>(node.mesh);
    if (node.skin >= 0 && skinned[mesh] < model.meshes[mesh].primitives.size()) {
      issues.warn(
          "NODE_SKIN_WITH_NON_SKINNED_MESH", fmt::format("/nodes/{}/skin", i),
          fmt::format("mesh {} has a primitive without joints, which is not skinned", node.mesh));
    }
    if (node.skin < 0 && skinned[mesh] > 0) {
      issues.warn("NODE_SKINNED_MESH_WITHOUT_SKIN", fmt::format("/nodes/{}/mesh", i),
                  fmt::format("mesh {} has joints, the node has no skin", node.mesh));
    }
  }
}

void check_animation_links(const tinygltf::Model& model, Issues& issues) {
  for (std::size_t i = 0; i < model.animations.size(); ++i) {
    const auto& animation = model.animations[i];
    const std::string pointer = fmt::format("/animations/{}", i);
    for (std::size_t s = 0; s < animation.samplers.size() && !issues.failed(); ++s) {
      const auto& sampler = animation.samplers[s];
      const auto& input = model.accessors[static_cast<std::size_t>(sampler.input)];
      const std::string place = fmt::format("{}/samplers/{}/input", pointer, s);
      if (input.type != TINYGLTF_TYPE_SCALAR ||
          input.componentType != TINYGLTF_COMPONENT_TYPE_FLOAT) {
        issues.invalid(
            "ANIMATION_SAMPLER_INPUT_ACCESSOR_INVALID_FORMAT", place,
            fmt::format("needs SCALAR of FLOAT, accessor {} is {}", sampler.input, name_of(input)));
      } else if (sampler.interpolation == "CUBICSPLINE" && input.count < 2) {
        issues.invalid("ANIMATION_SAMPLER_INPUT_ACCESSOR_TOO_FEW_ELEMENTS", place,
                       fmt::format("a cubic spline needs 2 keys, accessor {} has {}", sampler.input,
                                   input.count));
      }
    }
    for (std::size_t c = 0; c < animation.channels.size() && !issues.failed(); ++c) {
      check_channel(model, animation, animation.channels[c],
                    fmt::format("{}/channels/{}", pointer, c), issues);
    }
  }
}

}  // namespace octrace::gltf
