// Takes a flattened scene from one moment of its document's animation to another, touching only
// what moved.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "backend/scene/animation.h"
#include "backend/scene/flatten.h"
#include "backend/scene/flatten_steps.h"

namespace octrace::scene {

// A moment of an animation in seconds; nothing: at rest, as the file stands without animation.
using Time = std::optional<double>;

// --frame N --fps F.
inline double frame_time(double frame, double fps) { return frame / fps; }
inline constexpr double kDefaultFps = 24.0;

// A scene's vertices and cameras at another moment, for the motion plane.
struct Moment {
  std::vector<kernels::Vec3> positions;  // as Scene::positions; empty: where the scene has them
  std::vector<Camera> cameras;           // as Scene::cameras
  std::shared_ptr<const Instancing> instancing;  // null: where the scene has them
};

// Where a camera of the scene stands in that moment; one that is not of the scene stays.
Camera camera_at(const Camera& camera, const Scene& scene, const Moment& moment);

class Animator {
 public:
  // Flattens the document at `time` into `scene` and keeps what later moments need of it, without
  // its encoded images. `animation`: as choose_animation() takes it. Errors: flatten()'s, and usage
  // where there is no such animation.
  static util::Result<std::unique_ptr<Animator>> open(gltf::Document document,
                                                      const FlattenOptions& options,
                                                      const std::string& animation, Time time,
                                                      Scene& scene);

  // False: the scene looks the same at any time, and the calls below cost nothing.
  bool moves() const { return animation_.has_value(); }

  // `scene`: the one that open() filled. Afterwards it has the same bits as one flattened at
  // `time`. An error (exit 4: a vertex beyond kMaxCoordinate at that time) leaves it in between,
  // and the next call puts it right.
  util::Result<SceneChanges> move_to(Time time, Scene& scene);

  // The scene's vertices and cameras at another time, without moving it.
  util::Result<Moment> at(Time time, const Scene& scene) const;

 private:
  struct Placement {
    Pose pose;
    std::vector<glm::dmat4> worlds;  // by node
  };
  Animator() = default;
  Placement placement(Time time) const;
  struct InstanceMoves {
    bool any = false, meshes = false;
  };
  std::vector<bool> moved_geometries(const Placement& to) const;
  InstanceMoves moved_instances(const Placement& to) const;
  bool any_moved(const std::vector<bool>& nodes, const Placement& to) const;

  gltf::Document document_;
  ScenePlan plan_;
  std::optional<Animation> animation_;
  Winding winding_;
  Placement now_;        // of the scene as it is
  bool broken_ = false;  // an error left it in between
};

}  // namespace octrace::scene
