// Every view of a job, in order, without holding them: scene by scene, frame by frame, camera by
// camera.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "backend/batch/camera_list.h"
#include "backend/batch/job.h"

namespace octrace::batch {

struct View {
  std::uint64_t index = 0;
  std::size_t scene = 0;
  std::uint64_t camera = 0;  // within the scene
  std::int64_t frame = 0;
  double time = 0.0;  // seconds
};

struct Shard {
  std::uint64_t index = 1, count = 1;  // I of N, from 1
};

class Plan {
 public:
  // Reads the JSON of scenes whose cameras have to be known. Usage errors: two files of the same
  // path; exit 6: more views than --max-views. `base` is the folder of relative outputs, "" or
  // ending in '/'.
  static util::Result<Plan> make(Job job, const std::string& base, const util::Limits& limits);

  const Job& job() const { return job_; }
  std::uint64_t views() const { return first_view_.back(); }
  std::uint64_t first_view(std::size_t scene) const { return first_view_[scene]; }
  // The views of a shard: [begin, end), a contiguous part; the parts differ by at most one view, or
  // one pack, in size.
  std::pair<std::uint64_t, std::uint64_t> part(const Shard& shard) const;
  View view(std::uint64_t index) const;
  PlannedCamera camera(const View& view) const;
  std::string camera_name(const View& view) const;

  // The output folder: "" or ending in '/'. Paths of files are relative to it.
  const std::string& folder() const { return folder_; }
  std::vector<Output> files(const View& view) const;  // of a packed job: names in its pack

  // Where the job has packs.
  std::uint64_t packs() const;
  std::uint64_t pack_of(std::uint64_t view) const { return view / job_.pack->views; }
  std::pair<std::uint64_t, std::uint64_t> views_of_pack(std::uint64_t pack) const;  // [begin, end)
  std::string pack_path(std::uint64_t pack) const;
  render::AovSet needed_aovs() const;
  // The folder that all of an output's files go into, and how many they are; 0: more than one
  // folder.
  struct Crowd {
    std::string folder;
    std::uint64_t files = 0;
  };
  Crowd largest_crowd() const;

  // What the job comes to: everything that decides what is rendered, with defaults, and the scene
  // files' identity. Equal texts: equal outputs.
  nlohmann::ordered_json meaning(const util::Limits& limits) const;

 private:
  void find_cameras(const util::Limits& limits);
  void choose_folder(const std::string& base);
  bool paths_surely_differ() const;  // false: they have to be compared
  util::Result<void> check_paths() const;
  const CameraList& cameras_of(std::size_t scene) const;
  PathFields fields(const View& view) const;

  Job job_;
  std::string folder_;
  std::string pack_folder_;                   // what comes before the packs' pattern
  std::vector<std::string> patterns_folder_;  // of each output, what comes before its pattern
  std::vector<CameraList> cameras_;
  std::vector<std::uint32_t> cameras_of_;  // by scene, of cameras_; empty: the first serves all
  std::vector<std::string> scene_names_;   // made by path_name()
  std::vector<std::uint64_t> first_view_;  // by scene, and the end
};

}  // namespace octrace::batch
