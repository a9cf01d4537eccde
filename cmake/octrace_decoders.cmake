# Decoders of compressed glTF geometry. Draco is linked statically: its shared library holds a copy of
# tinygltf under the same names as octrace's, of other options, and a megabyte of relocations.
find_package(draco REQUIRED)
find_package(meshoptimizer REQUIRED)
set(octrace_decoders draco::draco_static meshoptimizer::meshoptimizer)
