// Files that other programs encoded: gltfpack (meshopt with quantisation) and gltf-pipeline
// (Draco).
#include <gtest/gtest.h>

#include "backend/scene/builtin.h"
#include "tests/compression/encode.h"
#include "tests/compression/same.h"

namespace octrace::tests {
namespace {

struct Encoded {
  const char* file;
  double step;  // of the positions' quantisation, as a share of the largest extent
};

class OtherEncoders : public testing::TestWithParam<Encoded> {};

TEST_P(OtherEncoders, ShowTheSamePicture) {
  const auto plain = scene::make_builtin("paper");
  ASSERT_TRUE(plain);
  const auto document =
      gltf::load(std::string(OCTRACE_TEST_DATA "/compressed/") + GetParam().file, {});
  ASSERT_TRUE(document) << document.error().to_string();
  const scene::Scene decoded = flattened(*document);
  ASSERT_EQ(decoded.triangles.size(), plain->triangles.size());

  const kernels::Vec3 extent = plain->bounds.upper - plain->bounds.lower;
  const double step = GetParam().step * std::max({extent.x, extent.y, extent.z});
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(decoded.bounds.lower[c], plain->bounds.lower[c], step);
    EXPECT_NEAR(decoded.bounds.upper[c], plain->bounds.upper[c], step);
  }
  const Difference found = compare_pictures(*plain, decoded, 1e-3);
  EXPECT_GT(found.covered, found.pixels / 16);
  // Only rays that graze an edge may go either way.
  EXPECT_LE(found.masks, found.covered / 100);
  EXPECT_LE(found.depths, found.covered / 100);
  EXPECT_EQ(found.objects, found.masks);
}

INSTANTIATE_TEST_SUITE_P(Paper, OtherEncoders,
                         testing::Values(Encoded{"paper_gltfpack.glb", 1.0 / (1 << 14)},
                                         Encoded{"paper_gltf_pipeline.glb", 1.0 / (1 << 16)}),
                         [](const auto& encoded) {
                           const std::string file = encoded.param.file;
                           return file.substr(0, file.size() - 4);
                         });

}  // namespace
}  // namespace octrace::tests
