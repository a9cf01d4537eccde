// A 64-bit hash of text (FNV-1a, Fowler, Noll, Vo 1991), the same on every machine.
#pragma once

#include <cstdint>
#include <string_view>

namespace octrace::batch {

inline constexpr std::uint64_t kHashStart = 0xcbf29ce484222325ull;

inline std::uint64_t hash_text(std::string_view text, std::uint64_t hash = kHashStart) {
  for (const char c : text) {
    hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ull;
  }
  return hash;
}

}  // namespace octrace::batch
