// The seed paper's kernel (kernels/seed.h): one thread a pixel, launched over bands of rows.
#include "kernels/cuda/status.h"
#include "kernels/cuda/tracer.h"

namespace octrace::kernels::cuda {

namespace {

constexpr unsigned kBlockSide = 16;

__global__ void __launch_bounds__(kBlockSide* kBlockSide)
    seed_kernel(const __grid_constant__ SeedImage image, std::uint32_t first_row,
                std::uint32_t end_row, Report* report) {
  const std::uint32_t x = blockIdx.x * kBlockSide + threadIdx.x;
  const std::uint32_t y = first_row + blockIdx.y * kBlockSide + threadIdx.y;
  if (x >= image.width || y >= end_row) return;
  const Ray ray =
      camera_ray(image.camera, static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
  Hit hit;
  const TraceStatus status = seed_trace(image.scene, ray, &hit);
  image.hits[static_cast<std::uint64_t>(y) * image.width + x] = hit;
  if (status != TraceStatus::ok) report_failure(report, status, x, y);
}

}  // namespace

Status launch_seed(const SeedImage& image, std::uint32_t rows_a_launch, Report* report,
                   Stream stream) {
  for (std::uint32_t row = 0; row < image.height; row += rows_a_launch) {
    const std::uint32_t rows =
        rows_a_launch < image.height - row ? rows_a_launch : image.height - row;
    const dim3 grid((image.width + kBlockSide - 1) / kBlockSide,
                    (rows + kBlockSide - 1) / kBlockSide);
    seed_kernel<<<grid, dim3(kBlockSide, kBlockSide), 0, static_cast<cudaStream_t>(stream)>>>(
        image, row, row + rows, report);
    if (Status s = launch_status("launching the seed's kernel"); !s.ok()) return s;
  }
  return {};
}

}  // namespace octrace::kernels::cuda
