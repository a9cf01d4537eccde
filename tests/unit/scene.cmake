octrace_test(octrace_scene_test
  SOURCES scene_animator.cpp scene_builtin.cpp scene_camera.cpp scene_deform.cpp scene_files.cpp
          scene_extensions.cpp scene_flatten.cpp
          scene_info.cpp scene_materials.cpp scene_sampler.cpp
  LIBRARIES octrace_scene nlohmann_json::nlohmann_json
  LABELS unit)
