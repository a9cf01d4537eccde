#include "backend/batch/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <unordered_map>

#include "backend/batch/camera_sets.h"
#include "backend/batch/distinct_paths.h"
#include "backend/batch/hash.h"
#include "backend/batch/scene_probe.h"

namespace octrace::batch {

namespace {

using util::Result;

bool depends_on_scene(const CameraEntry& entry) {
  if (std::holds_alternative<AllCameras>(entry)) return true;
  const auto* named = std::get_if<NamedCamera>(&entry);
  return named != nullptr && std::holds_alternative<std::int64_t>(named->which);
}

util::Error too_many_views(const Job& job, std::uint64_t most) {
  return {util::Exit::limit, "",
          fmt::format("makes more than the {} views that --max-views allows", most), job.file, ""};
}

// The longest folder that both lie in: a common start that ends in '/'.
std::string common_folder(const std::string& a, const std::string& b) {
  const auto end = std::mismatch(a.begin(), a.end(), b.begin(), b.end()).first;
  const std::string start(a.begin(), end);
  const std::size_t slash = start.rfind('/');
  return slash == std::string::npos ? "" : start.substr(0, slash + 1);
}

}  // namespace

Result<Plan> Plan::make(Job job, const std::string& base, const util::Limits& limits) {
  Plan plan;
  plan.job_ = std::move(job);
  plan.find_cameras(limits);
  for (const JobScene& scene : plan.job_.scenes) {
    plan.scene_names_.push_back(path_name(scene.name));
  }
  const std::uint64_t frames = std::max<std::uint64_t>(1, plan.job_.frames.size());
  plan.first_view_ = {0};
  for (std::size_t i = 0; i < plan.job_.scenes.size(); ++i) {
    const std::uint64_t cameras = plan.cameras_of(i).size();
    const std::uint64_t left = limits.max_views - plan.first_view_.back();
    if (cameras > left / frames) return too_many_views(plan.job_, limits.max_views);
    plan.first_view_.push_back(plan.first_view_.back() + cameras * frames);
  }
  plan.choose_folder(base);
  if (auto checked = plan.check_paths(); !checked) return checked.error();
  return plan;
}

void Plan::find_cameras(const util::Limits& limits) {
  const auto list = [&](const std::vector<std::string>* in_scene) {
    CameraList all;
    for (std::size_t e = 0; e < job_.cameras.size(); ++e) {
      const CameraEntry& entry = job_.cameras[e];
      if (const auto* given = std::get_if<GivenCameras>(&entry)) {
        std::vector<std::string> names;
        for (const scene::Camera& camera : given->cameras) names.push_back(camera.name);
        all.add(e, std::move(names));
      } else if (const auto* orbit = std::get_if<OrbitCameras>(&entry)) {
        all.add_numbered(e, orbit->name, orbit->n);
      } else if (const auto* named = std::get_if<NamedCamera>(&entry)) {
        if (const auto* name = std::get_if<std::string>(&named->which)) {
          all.add(e, {*name});
          continue;
        }
        const auto index = static_cast<std::size_t>(std::get<std::int64_t>(named->which));
        const bool known = in_scene != nullptr && index < in_scene->size();
        all.add(e, {known ? (*in_scene)[index] : fmt::format("camera {}", index)});
      } else if (in_scene == nullptr || in_scene->empty()) {
        all.add(e, {"framed"});
      } else {
        all.add(e, *in_scene);
      }
    }
    return all;
  };
  if (std::none_of(job_.cameras.begin(), job_.cameras.end(), depends_on_scene)) {
    cameras_.push_back(list(nullptr));
    return;
  }
  // The same file may come many times.
  std::map<std::pair<std::string, int>, std::uint32_t> seen;
  for (const JobScene& scene : job_.scenes) {
    const auto [at, is_new] = seen.try_emplace({scene.source, scene.scene.value_or(-1)},
                                               static_cast<std::uint32_t>(cameras_.size()));
    cameras_of_.push_back(at->second);
    if (!is_new) continue;
    const auto names = probe_cameras(scene, limits);
    cameras_.push_back(list(names ? &*names : nullptr));
  }
}

const CameraList& Plan::cameras_of(std::size_t scene) const {
  return cameras_[cameras_of_.empty() ? 0 : cameras_of_[scene]];
}

void Plan::choose_folder(const std::string& base) {
  if (job_.pack) {
    patterns_folder_.resize(job_.outputs.size());
    pack_folder_ = job_.pack->path.text().starts_with('/') ? "" : base;
    folder_ = pack_folder_ + job_.pack->path.folder();
    return;
  }
  for (const JobOutput& output : job_.outputs) {
    const bool absolute = output.pattern.text().starts_with('/');
    patterns_folder_.push_back(absolute ? "" : base);
    const std::string folder = patterns_folder_.back() + output.pattern.folder();
    folder_ = patterns_folder_.size() == 1 ? folder : common_folder(folder_, folder);
  }
}

std::pair<std::uint64_t, std::uint64_t> Plan::part(const Shard& shard) const {
  // floor(I V / N) without overflow: V and N are below 2^32 by far in practice, 128 bits in theory.
  const auto bound = [&](std::uint64_t i) {
    const std::uint64_t all = job_.pack ? packs() : views();
    const auto part =
        static_cast<std::uint64_t>(static_cast<unsigned __int128>(all) * i / shard.count);
    return job_.pack ? std::min(views(), part * job_.pack->views) : part;
  };
  return {bound(shard.index - 1), bound(shard.index)};
}

View Plan::view(std::uint64_t index) const {
  const auto after = std::upper_bound(first_view_.begin(), first_view_.end(), index);
  View view;
  view.index = index;
  view.scene = static_cast<std::size_t>(after - first_view_.begin()) - 1;
  const std::uint64_t rest = index - first_view_[view.scene];
  const std::uint64_t cameras = cameras_of(view.scene).size();
  view.camera = rest % cameras;
  if (!job_.frames.empty()) {
    view.frame = job_.frames[static_cast<std::size_t>(rest / cameras)];
    view.time = static_cast<double>(view.frame) / job_.fps;
  }
  return view;
}

PlannedCamera Plan::camera(const View& view) const {
  return cameras_of(view.scene).at(view.camera);
}

std::uint64_t Plan::packs() const {
  return views() / job_.pack->views + (views() % job_.pack->views != 0 ? 1 : 0);
}

std::pair<std::uint64_t, std::uint64_t> Plan::views_of_pack(std::uint64_t pack) const {
  const std::uint64_t begin = pack * job_.pack->views;
  return {begin, std::min(views(), begin + job_.pack->views)};
}

std::string Plan::pack_path(std::uint64_t pack) const {
  PathFields numbered;
  numbered.pack = pack;
  return pack_folder_ + job_.pack->path.path(numbered);
}

std::string Plan::camera_name(const View& view) const {
  return cameras_of(view.scene).name(view.camera);
}

PathFields Plan::fields(const View& view) const {
  PathFields fields;
  fields.scene = scene_names_[view.scene];
  fields.camera = cameras_of(view.scene).path_name(view.camera);
  fields.frame = view.frame;
  fields.view = view.index;
  fields.scene_index = view.scene;
  fields.camera_index = view.camera;
  return fields;
}

std::vector<Output> Plan::files(const View& view) const {
  std::vector<Output> files;
  PathFields values = fields(view);
  for (std::size_t i = 0; i < job_.outputs.size(); ++i) {
    const JobOutput& output = job_.outputs[i];
    for (std::size_t f = 0; f < output.files.size(); ++f) {
      if (output.pattern.has_aov()) values.aov = path_name(output.aov_words[f]);
      files.push_back(output.files[f]);
      files.back().path = patterns_folder_[i] + output.pattern.path(values);
    }
  }
  return files;
}

Plan::Crowd Plan::largest_crowd() const {
  Crowd largest;
  if (job_.pack) return {pack_folder_ + job_.pack->path.folder(), packs()};
  for (std::size_t i = 0; i < job_.outputs.size(); ++i) {
    const OutputPattern& pattern = job_.outputs[i].pattern;
    const auto& pieces = pattern.pieces();
    const auto spreads = [](const OutputPattern::Piece& piece) {
      return piece.field == OutputPattern::Field::literal &&
             piece.literal.find('/') != std::string::npos;
    };
    const bool starts_with_text =
        !pieces.empty() && pieces.front().field == OutputPattern::Field::literal;
    if (std::any_of(pieces.begin() + (starts_with_text ? 1 : 0), pieces.end(), spreads)) continue;
    const std::uint64_t files = views() * job_.outputs[i].files.size();
    if (files > largest.files) largest = {patterns_folder_[i] + pattern.folder(), files};
  }
  return largest;
}

render::AovSet Plan::needed_aovs() const {
  render::AovSet needed;
  for (const JobOutput& output : job_.outputs) needed |= batch::needed_aovs(output.files);
  if (job_.objects) needed.set(static_cast<std::size_t>(kernels::Aov::object_id));
  return needed;
}

bool Plan::paths_surely_differ() const {
  const PathSpace space{scene_names_, cameras_, cameras_of_, job_.frames, views()};
  for (std::size_t i = 0; i < job_.outputs.size(); ++i) {
    const JobOutput& output = job_.outputs[i];
    std::vector<std::string> aovs;
    for (std::size_t f = 0; output.pattern.has_aov() && f < output.files.size(); ++f) {
      aovs.push_back(path_name(output.aov_words[f]));
    }
    if (!surely_distinct(output.pattern, aovs, space)) return false;
    for (std::size_t j = 0; j < i; ++j) {
      if (!surely_apart(patterns_folder_[i], output.pattern, patterns_folder_[j],
                        job_.outputs[j].pattern)) {
        return false;
      }
    }
  }
  return true;
}

Result<void> Plan::check_paths() const {
  if (paths_surely_differ()) return {};
  // Hashes first: a job may have millions of paths, and two equal ones are rare.
  std::vector<std::uint64_t> hashes;
  const auto each = [&](const auto& use) {
    for (std::uint64_t index = 0; index < views(); ++index) {
      const View at = view(index);
      for (const Output& file : files(at)) use(at, file.path);
    }
  };
  each([&](const View&, const std::string& path) { hashes.push_back(hash_text(path)); });
  std::sort(hashes.begin(), hashes.end());
  if (std::adjacent_find(hashes.begin(), hashes.end()) == hashes.end()) return {};
  const auto twice = [&](const std::string& path) {
    const auto range = std::equal_range(hashes.begin(), hashes.end(), hash_text(path));
    return range.second - range.first > 1;
  };
  std::unordered_map<std::string, View> first;
  std::string message;
  each([&](const View& at, const std::string& path) {
    if (!message.empty() || !twice(path)) return;
    const auto [found, is_new] = first.try_emplace(path, at);
    if (is_new) return;
    const auto describe = [&](const View& one) {
      return fmt::format("scene {} ({}), camera {} ({}), frame {}", one.scene,
                         job_.scenes[one.scene].name, one.camera, camera_name(one), one.frame);
    };
    message = fmt::format(
        "two files would be {}: of {} and of {}; name scenes and cameras apart, or use "
        "{{scene_index}}, {{camera_index}} or {{view}}",
        path, describe(found->second), describe(at));
  });
  if (message.empty()) return {};
  return util::Error{util::Exit::usage, "", message, job_.file, "/output"};
}

}  // namespace octrace::batch
