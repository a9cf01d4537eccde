// Cameras and punctual lights.
#include <fmt/format.h>

#include <array>
#include <numbers>

#include "backend/gltf/structure.h"

namespace octrace::gltf {
namespace {

constexpr std::array<std::string_view, 2> kCameraTypes{"perspective", "orthographic"};
constexpr std::array<std::string_view, 3> kLightTypes{"directional", "point", "spot"};
constexpr double kUnbounded = std::numeric_limits<float>::max();
// Positive as a float, too.
constexpr double kPositive = std::numeric_limits<float>::min();

void check_far(const JsonRef& lens) {
  const JsonRef far_ref = lens.member("zfar");
  const auto near = lens.member("znear").as_number(0, kUnbounded);
  const auto far = far_ref.as_number(0, kUnbounded);
  if (near && far && *far <= *near) {
    lens.invalid("CAMERA_ZFAR_LEQUAL_ZNEAR",
                 fmt::format("needs zfar beyond znear, has {} and {}", *far, *near));
  }
}

void check_perspective(const JsonRef& lens) {
  (void)lens.required("znear").as_number(kPositive, kUnbounded);
  (void)lens.member("zfar").as_number(kPositive, kUnbounded);
  (void)lens.member("aspectRatio").as_number(kPositive, kUnbounded);
  const JsonRef yfov_ref = lens.required("yfov");
  const auto yfov = yfov_ref.as_number(kPositive, kUnbounded);
  if (yfov && *yfov >= std::numbers::pi) {
    yfov_ref.invalid("CAMERA_YFOV_GEQUAL_PI",
                     fmt::format("needs an angle below pi, has {}", *yfov));
  }
}

void check_orthographic(const JsonRef& lens) {
  (void)lens.required("znear").as_number(0, kUnbounded);
  (void)lens.required("zfar").as_number(kPositive, kUnbounded);
  for (const auto* key : {"xmag", "ymag"}) {
    const JsonRef mag_ref = lens.required(key);
    const auto mag = mag_ref.as_number();
    if (mag && *mag == 0) mag_ref.invalid("CAMERA_XMAG_YMAG_ZERO", "must not be zero");
    if (mag && *mag < 0) {
      lens.issues().warn("CAMERA_XMAG_YMAG_NEGATIVE", mag_ref.pointer(), "mirrors the image");
    }
  }
}

void check_light(const JsonRef& light) {
  check_common(light);
  const auto type = light.required("type").as_one_of(kLightTypes);
  const JsonRef color = light.member("color");
  if (color) (void)color.as_numbers(3, 0, 1);
  (void)light.member("intensity").as_number(0, kUnbounded);
  (void)light.member("range").as_number(kPositive, kUnbounded);
  if (type != "spot") return;
  const JsonRef spot = light.required("spot").as_object();
  if (!spot) return;
  constexpr double kHalfPi = std::numbers::pi / 2;
  // Exporters write pi/2 as a float, which is a little more.
  constexpr double kRounding = 1e-6;
  const double inner = spot.member("innerConeAngle").as_number(0, kHalfPi + kRounding).value_or(0);
  const double outer = spot.member("outerConeAngle")
                           .as_number(kPositive, kHalfPi + kRounding)
                           .value_or(std::numbers::pi / 4);
  if (outer <= inner) {
    const JsonRef outer_ref = spot.member("outerConeAngle");
    outer_ref.invalid(
        "KHR_LIGHTS_PUNCTUAL_LIGHT_SPOT_ANGLES",
        fmt::format("needs outerConeAngle above innerConeAngle, has {} and {}", outer, inner));
  }
}

}  // namespace

void check_cameras(const JsonRef& root) {
  each_object(root, "cameras", [&](const JsonRef& camera) {
    check_common(camera);
    const auto type = camera.required("type").as_one_of(kCameraTypes);
    if (!type) return;
    for (const auto other : kCameraTypes) {
      if (other != *type && camera.member(other)) {
        camera.invalid("ONE_OF_MISMATCH",
                       fmt::format("a camera of type {} also has {}", *type, other));
      }
    }
    const JsonRef lens = camera.required(*type).as_object();
    if (!lens) return;
    check_common(lens);
    if (*type == "perspective") {
      check_perspective(lens);
    } else {
      check_orthographic(lens);
    }
    check_far(lens);
  });
  const JsonRef extensions = root.member("extensions");
  const JsonRef punctual = extensions.member("KHR_lights_punctual");
  each_object(punctual, "lights", [](const JsonRef& light) { check_light(light); });
}

}  // namespace octrace::gltf
