// The flat records that a scene is made of, the same in host and device memory. World space,
// metres, right-handed, +Y up. Counter-clockwise corners face the viewer.
#pragma once

#include "kernels/config.h"

namespace octrace::kernels {

// Corners as indices into SceneView::positions. Winding is already swapped where the node's matrix
// mirrors, so that counter-clockwise is front everywhere.
struct Triangle {
  std::uint32_t a, b, c;
};

// One glTF primitive of one node: a run of triangles and a run of vertices. The attribute fields
// are the index of the first vertex's entry in the flat attribute array, or kNone where it has
// none.
struct Geometry {
  std::uint32_t first_triangle, triangle_count;
  std::uint32_t first_vertex, vertex_count;
  std::uint32_t object;    // glTF node index
  std::uint32_t material;  // index into SceneView::materials, always valid
  std::uint32_t normals, tangents, uv0, uv1, colors;
};

enum class AlphaMode : std::uint32_t { opaque, mask, blend };

// A material's use of a texture: which one, by which texture coordinates, moved how
// (KHR_texture_transform as rows of a 2x3 matrix applied to (u, v, 1)).
struct TextureRef {
  std::uint32_t texture = kNone;
  std::uint32_t texcoord = 0;  // 0 or 1
  Vec3 transform_u{1.0f, 0.0f, 0.0f};
  Vec3 transform_v{0.0f, 1.0f, 0.0f};
};

// glTF 2.0 metallic-roughness; factors are linear.
struct Material {
  Vec4 base_color{1.0f};
  Vec3 emissive{0.0f};  // factor times KHR_materials_emissive_strength
  float metallic = 1.0f;
  float roughness = 1.0f;
  float normal_scale = 1.0f;
  float occlusion_strength = 1.0f;
  float alpha_cutoff = 0.5f;
  AlphaMode alpha_mode = AlphaMode::opaque;
  std::uint32_t double_sided = 0;
  std::uint32_t unlit = 0;  // KHR_materials_unlit
  TextureRef base_color_texture;
  TextureRef metallic_roughness_texture;  // G roughness, B metallic
  TextureRef normal_texture;
  TextureRef occlusion_texture;  // R
  TextureRef emissive_texture;
};

enum class Wrap : std::uint32_t { repeat, clamp, mirror };
enum class Filter : std::uint32_t { nearest, linear };

// RGBA8, rows from the top, in SceneView::texels. Colour textures are stored as sRGB and decoded
// before filtering through SceneView::srgb_to_linear.
struct Texture {
  std::uint64_t first_texel;
  std::uint32_t width, height;
  Wrap wrap_s, wrap_t;
  Filter filter;
  std::uint32_t srgb;  // 1: RGB are sRGB-encoded; alpha never is
};

enum class LightType : std::uint32_t { directional, point, spot };

// KHR_lights_punctual: lux for directional lights, candela for the others.
struct Light {
  LightType type;
  Vec3 position;
  Vec3 direction;                 // unit, the way the light shines (directional, spot)
  Vec3 intensity;                 // colour times intensity, linear
  float range;                    // metres; +infinity: none
  float spot_scale, spot_offset;  // attenuation = clamp(cos(angle) * scale + offset, 0, 1)^2
};

}  // namespace octrace::kernels
