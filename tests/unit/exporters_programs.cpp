#include "tests/unit/exporters_programs.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>

#include "backend/image/image.h"
#include "tests/unit/exporters_scene.h"

namespace octrace::test {

bool installed(const std::string& program) {
  return std::system(fmt::format("command -v {} >/dev/null 2>&1", program).c_str()) == 0;
}

int run_in(const std::string& folder, const std::string& program,
           const std::vector<std::string>& arguments) {
  std::string line = fmt::format("cd '{}' && {}", folder, program);
  for (const std::string& argument : arguments) line += fmt::format(" '{}'", argument);
  line += fmt::format(" >'{}.log' 2>&1 </dev/null", program);
  const int status = std::system(line.c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

std::vector<Sight> through_povray(const scene::Scene& scene, const scene::Camera& camera,
                                  const exporters::PovrayOptions& options,
                                  const std::string& folder) {
  const auto file = exporters::write_povray(scene, camera, options, folder + "/view.pov");
  if (!file) {
    ADD_FAILURE() << file.error().to_string();
    return {};
  }
  const int code = run_in(folder, "povray", file->arguments);
  EXPECT_EQ(code, 0) << read_text(folder + "/povray.log");
  const auto image = image::read(folder + "/" + file->image, {});
  if (!image) {
    ADD_FAILURE() << image.error().to_string();
    return {};
  }
  const auto integer = [&](const char* channel, std::size_t i) {
    const image::Image::Plane* plane = image->find(channel);
    if (plane == nullptr) return 0.0;
    return plane->floats.empty() ? static_cast<double>(plane->uints[i])
                                 : std::round(static_cast<double>(plane->floats[i]) * 65535.0);
  };
  std::vector<Sight> sights(static_cast<std::size_t>(image->width) * image->height);
  for (std::size_t i = 0; i < sights.size(); ++i) {
    sights[i].object = static_cast<std::uint32_t>(integer("B", i));
    sights[i].depth = (integer("R", i) * exporters::kPovrayHalf + integer("G", i)) *
                      (file->depth_far / exporters::kPovrayDepthSteps);
    if (sights[i].object == 0) {
      EXPECT_EQ(integer("R", i) + integer("G", i), 0.0) << "background at pixel " << i;
    }
  }
  return sights;
}

void expect_same_sight(const std::vector<Sight>& expected, const std::vector<Sight>& actual,
                       int width, int slack, double error) {
  ASSERT_EQ(expected.size(), actual.size());
  int different = 0;
  double worst = 0.0;
  std::string first;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const std::size_t column = i % static_cast<std::size_t>(width);
    const std::size_t row = i / static_cast<std::size_t>(width);
    if (expected[i].object != actual[i].object) {
      ++different;
      if (first.empty()) {
        first = fmt::format("first at ({}, {}): {} expected, {} found", column, row,
                            expected[i].object, actual[i].object);
      }
    } else if (expected[i].object != 0) {
      const double e = std::abs(actual[i].depth - expected[i].depth) / expected[i].depth;
      // Silhouettes against something of the same object may fall on either side.
      if (e > 1e-3 && different < slack) {
        ++different;
        continue;
      }
      worst = std::max(worst, e);
    }
  }
  EXPECT_LE(different, slack) << first;
  EXPECT_LE(worst, error);
}

}  // namespace octrace::test
