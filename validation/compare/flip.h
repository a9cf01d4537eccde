// FLIP: how different two images look when one flips between them.
// Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild 2020, "FLIP: A Difference
// Evaluator for Alternating Images", Proc. ACM on Computer Graphics and Interactive Techniques
// 3(2).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace octrace::validation {

// The paper's viewing conditions: a 0.7 m wide display of 3840 pixels, seen from 0.7 m.
inline constexpr double kFlipPixelsPerDegree = 67.02064327658225;

// reference and test: linear RGB, three floats a pixel, values outside [0, 1] are clamped (the
// paper's measure is for what a display shows). Returns one value in [0, 1] a pixel.
std::vector<float> flip(std::span<const float> reference, std::span<const float> test,
                        std::uint32_t width, std::uint32_t height,
                        double pixels_per_degree = kFlipPixelsPerDegree);

}  // namespace octrace::validation
