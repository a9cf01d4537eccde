#include "backend/scene/animator.h"

#include <algorithm>
#include <cstring>

#include "backend/scene/flatten_placed.h"

namespace octrace::scene {

namespace {

// By bits, so that a scene that is left alone has those of one placed anew: -0 is not 0 here.
bool same_bits(const glm::dmat4& a, const glm::dmat4& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}
bool same_bits(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0);
}

bool is_skinned(const tinygltf::Model& model, const GeometryPlan::Source& source, int node) {
  const auto& attributes = model.meshes[source.mesh].primitives[source.primitive].attributes;
  return model.nodes[node].skin >= 0 && attributes.contains("JOINTS_0") &&
         attributes.contains("WEIGHTS_0");
}

}  // namespace

Camera camera_at(const Camera& camera, const Scene& scene, const Moment& moment) {
  for (std::size_t i = 0; i < scene.cameras.size() && i < moment.cameras.size(); ++i) {
    const Camera& candidate = scene.cameras[i];
    if (candidate.name == camera.name && candidate.type == camera.type &&
        candidate.yfov == camera.yfov && same_bits(candidate.matrix, camera.matrix)) {
      return moment.cameras[i];
    }
  }
  return camera;
}

util::Result<std::unique_ptr<Animator>> Animator::open(gltf::Document document,
                                                       const FlattenOptions& options,
                                                       const std::string& animation, Time time,
                                                       Scene& scene) {
  std::unique_ptr<Animator> animator(new Animator);
  const auto chosen = choose_animation(document, animation);
  if (!chosen) return chosen.error();
  if (*chosen) {
    auto read = Animation::read(document, **chosen);
    if (!read) return read.error();
    animator->animation_ = std::move(*read);
  }
  auto plan = plan_scene(document, options);
  if (!plan) return plan.error();
  animator->plan_ = std::move(*plan);
  animator->document_ = std::move(document);
  animator->now_ = animator->placement(time);
  auto placed = place_scene(animator->document_, animator->plan_, animator->now_.pose, options,
                            animator->winding_);
  if (!placed) return placed.error();
  scene = std::move(*placed);
  animator->document_.images.clear();
  // What never moves needs no document.
  if (!animator->moves()) *animator = Animator();
  return animator;
}

Animator::Placement Animator::placement(Time time) const {
  Placement placement;
  placement.pose = static_pose(document_.model);
  if (time && animation_) animation_->apply(*time, placement.pose);
  placement.worlds = world_matrices(document_.model, placement.pose);
  return placement;
}

std::vector<bool> Animator::moved_geometries(const Placement& to) const {
  const tinygltf::Model& model = document_.model;
  std::vector<bool> moved_nodes(model.nodes.size());
  for (std::size_t i = 0; i < moved_nodes.size(); ++i) {
    moved_nodes[i] = broken_ || !same_bits(now_.worlds[i], to.worlds[i]);
  }
  std::vector<bool> moved_skins(model.skins.size());
  for (std::size_t s = 0; s < moved_skins.size(); ++s) {
    const auto& joints = model.skins[s].joints;
    moved_skins[s] =
        std::any_of(joints.begin(), joints.end(), [&](int joint) { return moved_nodes[joint]; });
  }
  std::vector<bool> moved(plan_.geometry.geometries.size());
  for (const GeometryPlan::Source& source : plan_.geometry.sources) {
    for (const GeometryPlan::Instance& instance : source.instances) {
      const int node = instance.node;
      moved[instance.geometry] =
          is_skinned(model, source, node) ? moved_skins[model.nodes[node].skin] : moved_nodes[node];
      if (broken_ || !same_bits(now_.pose.weights[node], to.pose.weights[node])) {
        moved[instance.geometry] = true;
      }
    }
  }
  return moved;
}

Animator::InstanceMoves Animator::moved_instances(const Placement& to) const {
  InstanceMoves moves;
  for (const auto& shown : plan_.instances.nodes) {
    if (!same_bits(now_.worlds[shown.node], to.worlds[shown.node])) moves.any = true;
    if (!same_bits(now_.pose.weights[shown.node], to.pose.weights[shown.node])) {
      moves.any = moves.meshes = true;
    }
  }
  return moves;
}

util::Result<SceneChanges> Animator::move_to(Time time, Scene& scene) {
  if (!moves()) return SceneChanges{};
  Placement to = placement(time);
  const GeometryPlan part = part_of(plan_.geometry, moved_geometries(to));
  Scene placed;  // cameras and lights are few: all are placed again and compared
  if (auto ok = place_cameras(document_, plan_.nodes, to.worlds, placed); !ok) return ok.error();
  if (auto ok = place_lights(document_, plan_.visible, to.worlds, placed); !ok) return ok.error();
  const bool was_broken = broken_;
  broken_ = true;
  auto changes = replace_geometry(document_, part, to.pose, to.worlds, scene, winding_);
  if (!changes) return changes.error();
  const InstanceMoves moves = moved_instances(to);
  if (was_broken || moves.any) {
    scene.bounds = bounds_of(scene.positions);
    const std::size_t warnings = scene.warnings.size();
    auto placed_instances = place_instances(document_, plan_.instances, to.pose, to.worlds,
                                            !was_broken && !moves.meshes, scene);
    scene.warnings.resize(warnings);  // those of the first moment are enough
    if (!placed_instances) return placed_instances.error();
  } else if (changes->positions) {
    add_instance_bounds(scene);
  }
  broken_ = false;
  if (was_broken) *changes = {true, true, true, true, true, true, true, true, false};
  changes->instances = scene.instancing && (was_broken || moves.any);
  changes->cameras |= !std::equal(
      placed.cameras.begin(), placed.cameras.end(), scene.cameras.begin(), scene.cameras.end(),
      [](const Camera& a, const Camera& b) { return same_bits(a.matrix, b.matrix); });
  changes->lights |=
      placed.lights.size() != scene.lights.size() ||
      (!placed.lights.empty() && std::memcmp(placed.lights.data(), scene.lights.data(),
                                             placed.lights.size() * sizeof(kernels::Light)) != 0);
  if (changes->cameras) scene.cameras = std::move(placed.cameras);
  if (changes->lights) scene.lights = std::move(placed.lights);
  now_ = std::move(to);
  return changes;
}

util::Result<Moment> Animator::at(Time time, const Scene& scene) const {
  Moment moment;
  if (!moves()) return moment;
  const Placement to = placement(time);
  Scene placed;
  if (auto ok = place_cameras(document_, plan_.nodes, to.worlds, placed); !ok) return ok.error();
  moment.cameras = std::move(placed.cameras);
  if (scene.instancing && moved_instances(to).any) {
    placed.instancing = scene.instancing;
    if (auto ok = place_instances(document_, plan_.instances, to.pose, to.worlds, true, placed);
        !ok) {
      return ok.error();
    }
    // One that is left out at one of the two moments leaves no pairs.
    const auto &here = scene.instancing->instances, &there = placed.instancing->instances;
    if (std::equal(here.begin(), here.end(), there.begin(), there.end(),
                   [](const auto& a, const auto& b) { return a.object == b.object; })) {
      moment.instancing = placed.instancing;
    }
  }
  const GeometryPlan part = part_of(plan_.geometry, moved_geometries(to));
  if (part.sources.empty()) return moment;
  moment.positions = scene.positions;
  if (auto ok = replace_positions(document_, part, to.pose, to.worlds, moment.positions); !ok) {
    return ok.error();
  }
  return moment;
}

}  // namespace octrace::scene
