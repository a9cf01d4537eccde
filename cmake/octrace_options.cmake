# Language standard, warnings, sanitizers: what every target shares.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "" FORCE)
endif()
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
set(CMAKE_LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/lib)

find_program(OCTRACE_CCACHE ccache)
if(OCTRACE_CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${OCTRACE_CCACHE})
  set(CMAKE_CUDA_COMPILER_LAUNCHER ${OCTRACE_CCACHE})
endif()

# No contraction and no fast-math: images have the same bits on every device (docs/algorithm.md).
add_library(octrace_options INTERFACE)
target_compile_options(octrace_options INTERFACE
  $<$<COMPILE_LANGUAGE:CXX>:-Wall -Wextra -Wshadow -Wnon-virtual-dtor -Wno-psabi -ffp-contract=off>)
target_include_directories(octrace_options INTERFACE ${CMAKE_SOURCE_DIR})
if(OCTRACE_SANITIZE)
  target_compile_options(octrace_options INTERFACE
    $<$<COMPILE_LANGUAGE:CXX>:-fsanitize=${OCTRACE_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all>)
  target_link_options(octrace_options INTERFACE -fsanitize=${OCTRACE_SANITIZE})
endif()

# octrace_library(NAME SOURCES... [LIBRARIES...]): a static library with the shared options.
function(octrace_library name)
  cmake_parse_arguments(arg "" "" "SOURCES;LIBRARIES" ${ARGN})
  add_library(${name} STATIC ${arg_SOURCES})
  target_link_libraries(${name} PUBLIC octrace_options ${arg_LIBRARIES})
endfunction()

# octrace_test(NAME SOURCES... LIBRARIES... LABELS...): a GoogleTest program, one CTest name a case.
function(octrace_test name)
  cmake_parse_arguments(arg "" "TIMEOUT" "SOURCES;LIBRARIES;LABELS" ${ARGN})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 600)
  endif()
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE octrace_options ${arg_LIBRARIES} GTest::gtest_main)
  gtest_discover_tests(${name} DISCOVERY_TIMEOUT 60
    PROPERTIES LABELS "${arg_LABELS}" TIMEOUT ${arg_TIMEOUT})
endfunction()
