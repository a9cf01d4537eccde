// The named planes of one rendered image, in host memory.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "backend/util/huge_array.h"
#include "backend/util/result.h"
#include "kernels/aov.h"

namespace octrace::render {

using kernels::Aov;
using AovSet = std::bitset<kernels::kAovCount>;

struct AovInfo {
  Aov aov;
  std::string_view option;                   // as --aov names it
  std::string_view alias;                    // its channels' layer, which --aov takes as well
  std::array<std::string_view, 4> channels;  // as the EXR names them
  int channel_count;
  bool uint32;
  std::string_view description;
};

std::span<const AovInfo> aov_table();  // by Aov's order
const AovInfo& aov_info(Aov aov);

// A comma-separated list of options or aliases in any case, or "all". Exit 2 names what exists.
util::Result<AovSet> parse_aovs(std::string_view list);
std::string aov_names();  // "beauty, depth (Z), ..."

// What a device did to the memory of planes; undone before that is freed.
class PlaneHold {
 public:
  virtual ~PlaneHold() = default;
};

class Framebuffer {
 public:
  Framebuffer(std::uint32_t width, std::uint32_t height, AovSet aovs);
  Framebuffer(Framebuffer&&) = default;
  Framebuffer& operator=(Framebuffer&& other) noexcept;
  std::uint32_t width() const { return width_; }
  std::uint32_t height() const { return height_; }
  AovSet aovs() const { return aovs_; }
  std::span<const float> floats(Aov aov) const;
  std::span<const std::uint32_t> uints(Aov aov) const;
  kernels::FramebufferView view();
  std::span<std::uint32_t> words() { return {words_.data(), words_.size()}; }  // what is held
  std::unique_ptr<PlaneHold>& hold() { return hold_; }

 private:
  std::uint32_t width_, height_;
  AovSet aovs_;
  // All planes, one after the other: bits of float or uint32. Zeroed, by the system: at once that
  // would cost as much as tracing a view.
  util::HugeArray<std::uint32_t> words_;
  std::array<std::span<std::uint32_t>, kernels::kAovCount> planes_;
  std::unique_ptr<PlaneHold> hold_;
};

}  // namespace octrace::render
