// What differs in a scene between one moment and another.
#pragma once

namespace octrace::scene {

// Which arrays of a scene were written to; their sizes never change but those of the instances.
struct SceneChanges {
  bool positions = false, normals = false, tangents = false, uvs = false, colors = false;
  bool triangles = false;  // winding, where a node came to mirror or ceased to
  bool lights = false, cameras = false;
  bool instances = false;  // Scene::instancing is another one

  bool geometry() const { return positions || triangles || instances; }
  bool any() const {
    return geometry() || normals || tangents || uvs || colors || lights || cameras;
  }
};

}  // namespace octrace::scene
