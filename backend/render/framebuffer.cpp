#include "backend/render/framebuffer.h"

#include <bit>

namespace octrace::render {

namespace {
constexpr std::size_t kLine = 16;  // words of a line of the cache, where planes begin
}

Framebuffer::Framebuffer(std::uint32_t width, std::uint32_t height, AovSet aovs)
    : width_(width), height_(height), aovs_(aovs) {
  const std::size_t pixels = static_cast<std::size_t>(width) * height;
  std::array<std::size_t, kernels::kAovCount> begin{}, size{};
  std::size_t words = 0;
  for (const AovInfo& info : aov_table()) {
    const auto plane = static_cast<std::size_t>(info.aov);
    if (!aovs.test(plane)) continue;
    begin[plane] = words;
    size[plane] = pixels * static_cast<std::size_t>(info.channel_count);
    words += (size[plane] + kLine - 1) / kLine * kLine;
  }
  words_ = util::HugeArray<std::uint32_t>(words);
  for (std::size_t i = 0; i < planes_.size(); ++i) {
    if (size[i] != 0) planes_[i] = {words_.data() + begin[i], size[i]};
  }
}

Framebuffer& Framebuffer::operator=(Framebuffer&& other) noexcept {
  hold_.reset();  // before the planes that it is of
  width_ = other.width_;
  height_ = other.height_;
  aovs_ = other.aovs_;
  words_ = std::move(other.words_);
  planes_ = other.planes_;
  hold_ = std::move(other.hold_);
  return *this;
}

// Planes are allocated as 32-bit words, and kernels fill them as float or uint32 through void*; the
// two have one size and alignment, and each plane is read as what it was written as.
std::span<const float> Framebuffer::floats(Aov aov) const {
  const auto& plane = planes_[static_cast<std::size_t>(aov)];
  if (aov_info(aov).uint32) return {};
  return {reinterpret_cast<const float*>(plane.data()), plane.size()};
}

std::span<const std::uint32_t> Framebuffer::uints(Aov aov) const {
  if (!aov_info(aov).uint32) return {};
  return planes_[static_cast<std::size_t>(aov)];
}

kernels::FramebufferView Framebuffer::view() {
  kernels::FramebufferView view;
  view.width = width_;
  view.height = height_;
  for (std::size_t i = 0; i < planes_.size(); ++i)
    view.planes[i] = planes_[i].empty() ? nullptr : planes_[i].data();
  return view;
}

}  // namespace octrace::render
