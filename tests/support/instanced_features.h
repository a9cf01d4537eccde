// One scene that has, under its instances, everything that a surface can have, and the same scene
// with a node for each instance, which any reader of glTF shows.
#pragma once

#include "tests/unit/scene_support.h"

namespace octrace::tests {

struct InstancedPair {
  scene::testing::GltfFile instances;
  scene::testing::GltfFile nodes;  // node N + i shows instance i, with N nodes in `instances`
};

// Textures, alpha MASK and BLEND, single-sided materials, normal textures with tangents and
// without, vertex colours; scales that differ by axis, mirror and shear; two primitives a mesh; a
// mesh that one node shows plainly and two others by instances. Long thin triangles among them, for
// builders that cut.
InstancedPair instanced_features();

// Each image is a pattern of its own, half of it clear, by its number in instanced_features().
scene::FlattenOptions pattern_images();

}  // namespace octrace::tests
