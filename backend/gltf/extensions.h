// What octrace does with each glTF extension.
#pragma once

#include <string_view>

namespace octrace::gltf {

enum class Support {
  honoured,      // its meaning is followed
  approximated,  // geometry is exact without it; surfaces look simpler. Accepted, with a warning
  unknown,       // refused where required, ignored with a warning where not
};

Support extension_support(std::string_view name);

}  // namespace octrace::gltf
