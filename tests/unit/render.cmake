octrace_test(octrace_render_test
  SOURCES render_alpha.cpp render_aovs.cpp render_beauty.cpp render_brdf.cpp render_geometry.cpp
          render_lights.cpp render_motion.cpp render_outline.cpp render_scene.cpp render_texture.cpp render_tiles.cpp
  LIBRARIES octrace_render
  LABELS unit)
