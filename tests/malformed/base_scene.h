// A small valid scene that uses every part of glTF octrace reads; tests break it one place at a
// time.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

namespace octrace::tests {

std::string base64(std::span<const std::uint8_t> bytes);
std::string data_uri(std::span<const std::uint8_t> bytes,
                     const std::string& mime = "application/octet-stream");

// Bytes of a one-pixel PNG.
std::vector<std::uint8_t> tiny_png();

// The scene's one buffer, and the offsets that base_scene() puts into its buffer views.
std::vector<std::uint8_t> base_buffer();
nlohmann::json base_scene();

// A GLB of a JSON text and, unless empty, a BIN chunk.
std::vector<std::uint8_t> make_glb(const std::string& json, std::span<const std::uint8_t> bin);

}  // namespace octrace::tests
