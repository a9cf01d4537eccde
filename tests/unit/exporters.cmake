octrace_test(octrace_exporters_test
  SOURCES exporters_blender_script.cpp exporters_gltf.cpp exporters_scene.cpp exporters_text.cpp
  LIBRARIES octrace_exporters octrace_scene octrace_gltf octrace_image
  LABELS unit)

# What the exported files mean to POV-Ray, Blender and the Khronos validator, against a ray caster of
# the test's own. Skips where a program is not installed.
octrace_test(octrace_exporters_programs_test
  SOURCES exporters_blender.cpp exporters_khronos.cpp exporters_povray.cpp exporters_programs.cpp
          exporters_ray_caster.cpp exporters_scene.cpp
  LIBRARIES octrace_exporters octrace_scene octrace_gltf octrace_image
  LABELS validation)
target_compile_definitions(octrace_exporters_programs_test PRIVATE
  OCTRACE_TEST_CACHE="${CMAKE_BINARY_DIR}/test_cache"
  OCTRACE_EXPORT_SCENE="${CMAKE_SOURCE_DIR}/exporters/blender/export_scene.py")
