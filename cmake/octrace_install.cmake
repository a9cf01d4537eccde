# `cmake --install DIR` puts the program beside its image module. The component `bundle` adds the
# shared libraries that they need, all but the C and C++ run time, so that the tree runs on any
# x86-64 Linux whose own run time is no older (script/bundle); `bundle-bench` the bench program's.
include(GNUInstallDirs)

# DT_RPATH, not DT_RUNPATH: it also serves the libraries that those libraries need, so that none of
# them needs a path of its own. In the build tree as well: CMake would keep room for the path by
# colons there, and each of 258 libraries would be looked for 10 times in the current folder.
function(octrace_relocatable target)
  set_target_properties(${target} PROPERTIES
    INSTALL_RPATH "$ORIGIN/../lib" BUILD_WITH_INSTALL_RPATH ON)
  target_link_options(${target} PRIVATE -Wl,--disable-new-dtags)
endfunction()

# The parts of the C library belong together, and the driver's libraries to the driver.
set(octrace_not_bundled
  "^(ld-linux.*|lib(c|m|mvec|dl|rt|pthread|resolv|util|nsl|anl|nss_.*|stdc\\+\\+|gcc_s|cuda|nvidia-.*))\\.so(\\..*)?$")

# Where a bundled library has a DT_RUNPATH of its own, the program's DT_RPATH would not count there.
function(octrace_install_dependencies set component)
  install(RUNTIME_DEPENDENCY_SET ${set}
    PRE_EXCLUDE_REGEXES ${octrace_not_bundled}
    LIBRARY DESTINATION lib COMPONENT ${component} EXCLUDE_FROM_ALL)
  install(CODE [[
    file(GLOB libraries "$ENV{DESTDIR}${CMAKE_INSTALL_PREFIX}/lib/*.so*")
    foreach(library IN LISTS libraries)
      if(NOT IS_SYMLINK "${library}" AND NOT library MATCHES "/liboctrace_")
        file(RPATH_REMOVE FILE "${library}")
      endif()
    endforeach()]]
    COMPONENT ${component} EXCLUDE_FROM_ALL)
endfunction()

octrace_relocatable(octrace)
octrace_relocatable(octrace_image_module)
install(TARGETS octrace octrace_image_module RUNTIME_DEPENDENCY_SET octrace_dependencies
  RUNTIME DESTINATION bin COMPONENT octrace
  LIBRARY DESTINATION lib COMPONENT octrace)
octrace_install_dependencies(octrace_dependencies bundle)
install(FILES ${CMAKE_SOURCE_DIR}/backend/batch/job.schema.json
  DESTINATION share/octrace COMPONENT octrace)
foreach(document README.md LICENSE SECURITY.md)
  install(FILES ${CMAKE_SOURCE_DIR}/${document} DESTINATION ${CMAKE_INSTALL_DOCDIR}
    COMPONENT octrace OPTIONAL)
endforeach()

if(TARGET octrace-bench)
  octrace_relocatable(octrace-bench)
  install(TARGETS octrace-bench RUNTIME_DEPENDENCY_SET octrace_bench_dependencies
    RUNTIME DESTINATION bin COMPONENT bench EXCLUDE_FROM_ALL)
  octrace_install_dependencies(octrace_bench_dependencies bundle-bench)
endif()
