#include "backend/batch/distinct_paths.h"

#include <algorithm>
#include <optional>
#include <unordered_set>

#include "backend/batch/hash.h"

namespace octrace::batch {

namespace {

using Field = OutputPattern::Field;
using Piece = OutputPattern::Piece;

bool is_name(Field field) {
  return field == Field::scene || field == Field::camera || field == Field::aov;
}

// Whether path_name() or a number may hold the character.
bool may_hold(Field field, char c) {
  if (c >= '0' && c <= '9') return true;
  if (!is_name(field)) return false;
  const auto byte = static_cast<unsigned char>(c);
  return byte >= 0x80 || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '-' || c == '_' ||
         c == '.' || c == '+';
}

bool all_differ(std::span<const std::string> names) {
  std::unordered_set<std::string_view> seen(names.begin(), names.end());
  return seen.size() == names.size();
}

class Proof {
 public:
  Proof(const OutputPattern& pattern, const std::vector<std::string>& aovs, const PathSpace& space)
      : pieces_(pattern.pieces()), aovs_(aovs), space_(space) {}

  bool holds() const {
    if (!names_the_view()) return false;
    // Read from both ends, a path gives its fields back as long as it is clear where each ends; the
    // last one in between is what is left.
    std::size_t begin = 0, end = pieces_.size();
    while (begin < end && ends_clearly(begin)) ++begin;
    while (end > begin && starts_clearly(end - 1)) --end;
    return end - begin <= 1 || read_together(begin, end);
  }

 private:
  bool has(Field field) const {
    return std::any_of(pieces_.begin(), pieces_.end(), [&](const Piece& piece) {
      return piece.field == field && piece.divisor == 1;
    });
  }

  // Whether the values of the fields tell which view and which plane it is.
  bool names_the_view() const {
    if (aovs_.size() > 1 && !(has(Field::aov) && all_differ(aovs_))) return false;
    if (has(Field::view)) return true;
    if (space_.scenes.size() > 1 && !has(Field::scene_index) &&
        !(has(Field::scene) && all_differ(space_.scenes))) {
      return false;
    }
    if (space_.frames.size() > 1 && !has(Field::frame)) return false;
    if (has(Field::camera_index)) return true;
    return std::all_of(space_.cameras.begin(), space_.cameras.end(), [&](const CameraList& list) {
      return list.size() < 2 || (has(Field::camera) && list.paths_surely_differ());
    });
  }

  // The length of all values of a field, where they have one.
  std::optional<std::size_t> length(const Piece& piece) const {
    if (piece.field == Field::literal) return piece.literal.size();
    if (piece.field == Field::aov) return common_length(aovs_);
    if (piece.field == Field::scene) return common_length(space_.scenes);
    if (piece.field == Field::camera) return camera_length();
    const std::size_t longest = std::to_string(last_number(piece.field) / piece.divisor).size();
    if (static_cast<std::size_t>(piece.width) >= longest) return piece.width;
    return longest == 1 ? std::optional<std::size_t>(1) : std::nullopt;
  }
  static std::optional<std::size_t> common_length(std::span<const std::string> names) {
    for (const std::string& name : names) {
      if (name.size() != names.front().size()) return std::nullopt;
    }
    if (names.empty()) return std::nullopt;
    return names.front().size();
  }
  std::optional<std::size_t> camera_length() const {
    const auto length = space_.cameras.front().path_length();
    for (const CameraList& list : space_.cameras) {
      if (list.path_length() != length) return std::nullopt;
    }
    return length;
  }
  std::int64_t last_number(Field field) const {
    if (field == Field::view) return static_cast<std::int64_t>(space_.views) - 1;
    if (field == Field::scene_index) return static_cast<std::int64_t>(space_.scenes.size()) - 1;
    if (field == Field::frame) {
      return space_.frames.empty() ? 0
                                   : *std::max_element(space_.frames.begin(), space_.frames.end());
    }
    std::uint64_t most = 1;
    for (const CameraList& list : space_.cameras) most = std::max(most, list.size());
    return static_cast<std::int64_t>(most) - 1;
  }

  bool ends_clearly(std::size_t at) const {
    if (length(pieces_[at])) return true;
    return at + 1 < pieces_.size() && pieces_[at + 1].field == Field::literal &&
           !may_hold(pieces_[at].field, pieces_[at + 1].literal.front());
  }
  bool starts_clearly(std::size_t at) const {
    if (length(pieces_[at])) return true;
    return at > 0 && pieces_[at - 1].field == Field::literal &&
           !may_hold(pieces_[at].field, pieces_[at - 1].literal.back());
  }

  // Fields of scenes and cameras whose bounds are not clear ("{scene}_{camera}"): all pairs are
  // written out, once for all frames.
  bool read_together(std::size_t begin, std::size_t end) const {
    for (std::size_t i = begin; i < end; ++i) {
      const Field field = pieces_[i].field;
      if (field == Field::frame || field == Field::view || field == Field::aov) return false;
    }
    std::vector<std::uint64_t> hashes;
    for (std::size_t scene = 0; scene < space_.scenes.size(); ++scene) {
      const CameraList& cameras = space_.cameras_in(scene);
      for (std::uint64_t camera = 0; camera < cameras.size(); ++camera) {
        std::uint64_t hash = kHashStart;
        for (std::size_t i = begin; i < end; ++i) {
          hash = hash_text(text(pieces_[i], scene, camera), hash);
        }
        hashes.push_back(hash);
      }
    }
    std::sort(hashes.begin(), hashes.end());
    return std::adjacent_find(hashes.begin(), hashes.end()) == hashes.end();
  }
  std::string text(const Piece& piece, std::size_t scene, std::uint64_t camera) const {
    PathFields fields;
    fields.scene = space_.scenes[scene];
    fields.camera = space_.cameras_in(scene).path_name(camera);
    fields.scene_index = scene;
    fields.camera_index = camera;
    return OutputPattern::path(piece, fields);
  }

  const std::vector<Piece>& pieces_;
  const std::vector<std::string>& aovs_;
  const PathSpace& space_;
};

}  // namespace

bool surely_distinct(const OutputPattern& pattern, const std::vector<std::string>& aovs,
                     const PathSpace& space) {
  return Proof(pattern, aovs, space).holds();
}

bool surely_apart(const std::string& head_a, const OutputPattern& a, const std::string& head_b,
                  const OutputPattern& b) {
  const std::string_view tail_a = a.tail(), tail_b = b.tail();
  if (!tail_a.ends_with(tail_b) && !tail_b.ends_with(tail_a)) return true;
  const auto start = [](const std::string& head, const OutputPattern& pattern) {
    const bool literal =
        !pattern.pieces().empty() && pattern.pieces().front().field == Field::literal;
    return head + (literal ? pattern.pieces().front().literal : "");
  };
  const std::string start_a = start(head_a, a), start_b = start(head_b, b);
  return !start_a.starts_with(start_b) && !start_b.starts_with(start_a);
}

}  // namespace octrace::batch
