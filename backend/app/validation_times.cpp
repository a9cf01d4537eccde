#include "backend/app/validation_times.h"

#include <fmt/format.h>

#include <cstddef>

#include "backend/gltf/document.h"
#include "backend/scene/animation.h"
#include "backend/scene/builtin.h"

namespace octrace::app {

namespace {

// `count` of them, evenly by number, the first and the last among them; 0: all.
std::vector<double> spread(const std::vector<double>& times, std::size_t count) {
  if (count == 0 || count >= times.size()) return times;
  std::vector<double> some;
  for (std::size_t i = 0; i < count; ++i) {
    some.push_back(times[count == 1 ? 0 : i * (times.size() - 1) / (count - 1)]);
  }
  return some;
}

}  // namespace

util::Result<std::vector<ValidationTime>> validation_times(const batch::SceneRequest& request,
                                                           const TimeOptions& options,
                                                           std::optional<int> keys) {
  const std::vector<ValidationTime> one{{options.animation, options.time(), ""}};
  if (!keys || request.source.starts_with(scene::kBuiltinPrefix)) return one;
  auto document = gltf::load(request.source, {request.limits, true});
  if (!document) return document.error();
  auto chosen = scene::choose_animation(*document, options.animation);
  if (!chosen) return chosen.error();
  if (!*chosen) return one;
  std::vector<ValidationTime> times;
  const auto count = static_cast<int>(document->model.animations.size());
  for (int i = 0; i < count; ++i) {
    if (!options.animation.empty() && i != **chosen) continue;
    auto animation = scene::Animation::read(*document, i);
    if (!animation) return animation.error();
    for (const double time : spread(animation->shared_keys(), static_cast<std::size_t>(*keys))) {
      const std::string which = count > 1 ? fmt::format(" animation {}", i) : "";
      times.push_back({std::to_string(i), time, fmt::format("{} at {:.4g} s", which, time)});
    }
  }
  return times;
}

}  // namespace octrace::app
