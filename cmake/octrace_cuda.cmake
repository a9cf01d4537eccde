# Enables CUDA where a toolkit is found (OCTRACE_CUDA=AUTO), and sets OCTRACE_HAVE_CUDA.
set(OCTRACE_HAVE_CUDA OFF)
if(NOT OCTRACE_CUDA STREQUAL "OFF")
  include(CheckLanguage)
  if(NOT CMAKE_CUDA_COMPILER AND EXISTS /usr/local/cuda/bin/nvcc)
    set(CMAKE_CUDA_COMPILER /usr/local/cuda/bin/nvcc)
  endif()
  # Code for the data centre's Ampere and Hopper; everything from Turing on compiles the PTX.
  set(OCTRACE_CUDA_ARCHITECTURES 75-virtual 80-real 90-real CACHE STRING
      "GPUs to compile for, as in CMAKE_CUDA_ARCHITECTURES; fewer build faster")
  set(CMAKE_CUDA_ARCHITECTURES ${OCTRACE_CUDA_ARCHITECTURES})
  check_language(CUDA)
  if(CMAKE_CUDA_COMPILER)
    enable_language(CUDA)
    set(OCTRACE_HAVE_CUDA ON)
    set(CMAKE_CUDA_STANDARD 20)
    set(CMAKE_CUDA_STANDARD_REQUIRED ON)
    # CMake 3.25 does not know that nvcc speaks C++20.
    set(CMAKE_CUDA20_STANDARD_COMPILE_OPTION "-std=c++20")
    set(CMAKE_CUDA20_EXTENSION_COMPILE_OPTION "-std=c++20")
  elseif(OCTRACE_CUDA STREQUAL "ON")
    message(FATAL_ERROR "OCTRACE_CUDA=ON, but no CUDA compiler was found")
  endif()
endif()
