// Paths of a job's outputs: "out/{scene}/{camera}_{frame:04}.exr" (docs/batch.md).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "backend/util/result.h"

namespace octrace::batch {

// What the fields of one view stand for; names as places in a path, made by path_name().
struct PathFields {
  std::string scene, camera, aov;
  std::int64_t frame = 0;
  std::uint64_t view = 0, scene_index = 0, camera_index = 0, pack = 0;
};

class OutputPattern {
 public:
  enum class Field { literal, scene, camera, frame, view, scene_index, camera_index, aov, pack };
  struct Piece {
    Field field = Field::literal;
    std::string literal;
    int width = 0;             // of a number, with leading zeros
    std::int64_t divisor = 1;  // of a number: {view/1000}
  };

  // The error's message says what is wrong, without a place.
  static util::Result<OutputPattern> parse(std::string_view text);

  std::string path(const PathFields& fields) const;
  static std::string path(const Piece& piece, const PathFields& fields);
  bool has_aov() const { return has(Field::aov); }
  bool has(Field field) const;
  std::string folder() const;     // up to the last '/' before the first field; may be empty
  std::string_view tail() const;  // the text after the last field: it holds the extension
  const std::string& text() const { return text_; }
  const std::vector<Piece>& pieces() const { return pieces_; }

 private:
  static util::Result<Piece> parse_field(std::string_view text);
  std::string text_;
  std::vector<Piece> pieces_;
};

// A name from a file as one part of a path: letters (any script), digits and - _ . + stay; the
// rest, a leading dot and what is not UTF-8 become '_'; at most 100 bytes, never empty.
std::string path_name(std::string_view name);

}  // namespace octrace::batch
