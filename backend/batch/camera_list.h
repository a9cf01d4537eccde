// The cameras of a scene as a job names them. Those that are counted, NAME_000 and so on, are not
// held one by one: there may be 10^9.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace octrace::batch {

// One camera of a scene: its place in the job's entries.
struct PlannedCamera {
  std::size_t entry = 0;    // of Job::cameras
  std::uint64_t index = 0;  // within the entry
};

class CameraList {
 public:
  void add(std::size_t entry, std::vector<std::string> names);
  void add_numbered(std::size_t entry, const std::string& name, std::uint64_t count);

  std::uint64_t size() const { return size_; }
  PlannedCamera at(std::uint64_t camera) const;
  std::string name(std::uint64_t camera) const;
  std::string path_name(std::uint64_t camera) const;  // made by batch::path_name()

  // True: no two path names are the same. False: they may be. The counted ones are not looked at
  // one by one.
  bool paths_surely_differ() const;
  // Of all path names; nothing where they have several, or there is none.
  std::optional<std::size_t> path_length() const;

 private:
  struct Group {
    std::size_t entry = 0;
    std::uint64_t first = 0, count = 0;
    std::vector<std::string> names;  // empty: `start` and a number
    std::string start;

    std::string name(std::uint64_t index) const;
  };
  const Group& group_of(std::uint64_t camera) const;
  std::vector<Group> groups_;
  std::uint64_t size_ = 0;
};

}  // namespace octrace::batch
