octrace_test(octrace_gltf_test
  SOURCES gltf_accessor.cpp gltf_document.cpp gltf_image_header.cpp gltf_uri.cpp
  LIBRARIES octrace_gltf octrace_test_scenes
  LABELS unit)
