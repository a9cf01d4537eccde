// Splits in place by many threads (backend/octree/exchange.h). They are std::threads, since a
// thread sanitizer cannot see how TBB's are ordered.
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <random>
#include <thread>

#include "backend/octree/exchange.h"
#include "tests/support/intensity.h"

namespace octrace::tests {
namespace {

using octree::LooseReference;

constexpr std::uint32_t kThreads = 8;

// Boxes of all sizes. `share` lies on the lower side of the middle of axis 0.
std::vector<LooseReference> make_references(std::uint32_t count, double share, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<float> place(0.0f, 0.48f);
  std::bernoulli_distribution lower(share);
  std::vector<LooseReference> references(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    LooseReference& r = references[i];
    const float x = place(random) + (lower(random) ? 0.0f : 0.51f);
    const float y = place(random), z = place(random);
    r = {{x, y, z}, i, {-x, -y - place(random), -z - place(random)}, 0, {i, ~i, i ^ 0x5555u, 7}};
  }
  return references;
}

struct Split {
  std::vector<LooseReference> references;
  std::uint32_t lower_count = 0;

  // Blocks are given to threads one by one, so that neighbours are at work at the same time.
  void run(std::uint32_t threads) {
    const octree::LooseSplitter splitter;
    const auto count = static_cast<std::uint32_t>(references.size());
    octree::Bounds8 all = splitter.bounds(references.data(), count);
    all.centres[0] = 0.0f;
    all.centres[4] = -2.0f;
    const octree::Binning binning(all, 16);
    octree::ObjectSplit split;
    split.axis = 0;
    split.bin = 8;
    lower_count = static_cast<std::uint32_t>(std::count_if(
        references.begin(), references.end(),
        [&](const LooseReference& r) { return binning.bin(r.centre2(0), 0) < split.bin; }));
    octree::Half lower(references.data(), lower_count, false);
    octree::Half upper(references.data() + lower_count, count - lower_count, true);
    tbb::task_arena(1).execute([&] {
      const octree::SidePlane plane(binning, split);
      lower.search(splitter, plane);
      upper.search(splitter, plane);
    });
    ASSERT_EQ(lower.misplaced(), upper.misplaced());
    std::atomic<std::uint32_t> next{0};
    const auto work = [&] {
      for (std::uint32_t block; (block = next++) < lower.blocks();) {
        octree::exchange_block(lower, upper, block);
      }
    };
    std::vector<std::thread> others;
    for (std::uint32_t i = 1; i < threads; ++i) others.emplace_back(work);
    work();
    for (std::thread& thread : others) thread.join();
  }

  std::vector<std::uint32_t> triangles() const {
    std::vector<std::uint32_t> all;
    for (const LooseReference& r : references) all.push_back(r.triangle);
    return all;
  }
};

// Blocks of the halves lie across each other: where one half is smaller, its blocks hold more
// strangers each, which several threads take.
TEST(OctreeExchange, SplitsAndLosesNothingWithAnyThreads) {
  for (std::uint64_t round = 0; round < scaled(10); ++round) {
    for (const double share : {0.5, 0.1, 0.9}) {
      for (const std::uint32_t count : {32769u, 70000u, 150000u}) {
        Split one{make_references(count, share, seed() + round), 0};
        const std::vector<LooseReference> before = one.references;
        Split many = one;
        one.run(1);
        many.run(kThreads);
        ASSERT_EQ(many.triangles(), one.triangles())
            << count << ", " << share << ", seed " << seed() + round;
        for (std::uint32_t i = 0; i < count; ++i) {
          const LooseReference& r = many.references[i];
          ASSERT_EQ(r.lower[0] < 0.5f, i < many.lower_count);
          ASSERT_LT(r.triangle, count);
          const LooseReference& old = before[r.triangle];
          ASSERT_TRUE(std::equal(r.lower, r.lower + 3, old.lower));
          ASSERT_TRUE(std::equal(r.negated_upper, r.negated_upper + 3, old.negated_upper));
          ASSERT_EQ(r.corners.a, old.corners.a);
          ASSERT_EQ(r.corners.b, old.corners.b);
          ASSERT_EQ(r.corners.c, old.corners.c);
          ASSERT_EQ(r.corners.geometry, old.corners.geometry);
        }
        std::vector<std::uint32_t> sorted = many.triangles();
        std::sort(sorted.begin(), sorted.end());
        for (std::uint32_t i = 0; i < count; ++i) ASSERT_EQ(sorted[i], i);
      }
    }
  }
}

}  // namespace
}  // namespace octrace::tests
