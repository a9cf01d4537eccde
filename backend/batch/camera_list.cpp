#include "backend/batch/camera_list.h"

#include <algorithm>
#include <unordered_set>

#include "backend/batch/camera_sets.h"
#include "backend/batch/output_pattern.h"

namespace octrace::batch {

void CameraList::add(std::size_t entry, std::vector<std::string> names) {
  if (names.empty()) return;
  const std::uint64_t count = names.size();
  groups_.push_back({entry, size_, count, std::move(names), ""});
  size_ += count;
}

void CameraList::add_numbered(std::size_t entry, const std::string& name, std::uint64_t count) {
  groups_.push_back({entry, size_, count, {}, name});
  size_ += count;
}

std::string CameraList::Group::name(std::uint64_t index) const {
  return names.empty() ? numbered(start, index, count) : names[index];
}

const CameraList::Group& CameraList::group_of(std::uint64_t camera) const {
  const auto after =
      std::upper_bound(groups_.begin(), groups_.end(), camera,
                       [](std::uint64_t value, const Group& group) { return value < group.first; });
  return *std::prev(after);
}

PlannedCamera CameraList::at(std::uint64_t camera) const {
  const Group& group = group_of(camera);
  return {group.entry, camera - group.first};
}

std::string CameraList::name(std::uint64_t camera) const {
  const Group& group = group_of(camera);
  return group.name(camera - group.first);
}

std::string CameraList::path_name(std::uint64_t camera) const {
  return batch::path_name(name(camera));
}

bool CameraList::paths_surely_differ() const {
  std::unordered_set<std::string> named;
  std::vector<std::string> starts;  // of the counted ones
  for (const Group& group : groups_) {
    for (const std::string& name : group.names) {
      if (!named.insert(batch::path_name(name)).second) return false;
    }
    if (!group.names.empty()) continue;
    // path_name() cuts what is too long, and with it the number.
    const std::string first = group.name(0);
    if (batch::path_name(first).size() != first.size()) return false;
    starts.push_back(batch::path_name(group.start + "_"));
  }
  for (std::size_t i = 0; i < starts.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (starts[i].starts_with(starts[j]) || starts[j].starts_with(starts[i])) return false;
    }
  }
  return std::none_of(starts.begin(), starts.end(), [&](const std::string& start) {
    return std::any_of(named.begin(), named.end(),
                       [&](const std::string& name) { return name.starts_with(start); });
  });
}

std::optional<std::size_t> CameraList::path_length() const {
  std::optional<std::size_t> common;
  for (const Group& group : groups_) {
    const std::uint64_t looked_at = group.names.empty() ? 1 : group.count;
    for (std::uint64_t i = 0; i < looked_at; ++i) {
      const std::size_t length = batch::path_name(group.name(i)).size();
      if (common && *common != length) return std::nullopt;
      common = length;
    }
  }
  return common;
}

}  // namespace octrace::batch
