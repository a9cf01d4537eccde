octrace_test(image_test
  SOURCES image_decode.cpp image_exr.cpp image_integer.cpp image_png_builder.cpp
  LIBRARIES GTest::gmock octrace_image octrace_util fmt::fmt
  LABELS unit)
# Reads the module's own header parser, which the thin library does not hold.
octrace_test(image_header_test
  SOURCES image_header.cpp image_png_builder.cpp ${CMAKE_SOURCE_DIR}/backend/image/encoded_header.cpp
  LABELS unit)
octrace_test(image_npy_test
  SOURCES image_npy.cpp zip_reader.cpp
  LIBRARIES GTest::gmock octrace_image octrace_util ZLIB::ZLIB fmt::fmt
  LABELS unit)
octrace_test(image_deflate_test
  SOURCES image_deflate.cpp
  LIBRARIES octrace_image octrace_util ZLIB::ZLIB ${CMAKE_DL_LIBS}
  LABELS unit)
# Part of the module as well.
octrace_test(image_file_proxy_test
  SOURCES image_file_proxy.cpp ${CMAKE_SOURCE_DIR}/backend/image/file_proxy.cpp
  LIBRARIES OpenImageIO::OpenImageIO
  LABELS unit)
