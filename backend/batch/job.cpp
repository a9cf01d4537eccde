#include "backend/batch/job.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>

#include "backend/batch/frame_list.h"
#include "backend/render/device.h"
#include "backend/scene/builtin.h"

namespace octrace::batch {

namespace {

using util::Result;

constexpr std::size_t kMostScenes = 10'000'000;

// The position of a word among some.
Result<std::size_t> word(const JsonAt& json, std::initializer_list<std::string_view> words) {
  auto text = json.value().is_string() ? json.value().get<std::string>() : std::string();
  const auto found = std::find(words.begin(), words.end(), text);
  if (found == words.end()) return json.needs(fmt::format("one of {}", fmt::join(words, ", ")));
  return static_cast<std::size_t>(found - words.begin());
}

// A name, or an index as text.
Result<std::string> parse_variant(const JsonAt& json) {
  if (!json.value().is_number()) return json.text();
  auto index = json.integer(0, 1 << 24);
  return index ? Result<std::string>(std::to_string(*index)) : index.error();
}

Result<JobScene> parse_scene(const JsonAt& json, const Job& job) {
  JobScene scene;
  scene.variant = job.variant;
  JsonAt path = json;
  if (json.value().is_object()) {
    if (auto ok = json.object({"path", "name", "scene", "variant"}, {"path"}); !ok) {
      return ok.error();
    }
    if (auto ok = read_member(json, "variant", scene.variant, parse_variant); !ok) {
      return ok.error();
    }
    path = json.at("path");
    if (json.has("name")) {
      auto name = json.at("name").text();
      if (!name) return name.error();
      scene.name = *name;
    }
    if (json.has("scene")) {
      auto index = json.at("scene").integer(0, 1 << 24);
      if (!index) return index.error();
      scene.scene = static_cast<int>(*index);
    }
  } else if (!json.value().is_string()) {
    return json.needs("a file, builtin:NAME or an object");
  }
  auto text = path.text();
  if (!text) return text.error();
  scene.path = *text;
  if (text->starts_with(scene::kBuiltinPrefix)) {
    scene.source = *text;
    if (scene.name.empty()) scene.name = text->substr(scene::kBuiltinPrefix.size());
  } else {
    scene.source = path_beside(job.folder, *text);
    if (scene.name.empty()) scene.name = std::filesystem::path(*text).stem().string();
  }
  if (scene.name.empty()) return path.needs("a file's name");
  return scene;
}

Result<void> parse_scenes(const JsonAt& json, Job& job) {
  auto count = json.array(1, kMostScenes);
  if (!count) return count.error();
  for (std::size_t i = 0; i < *count; ++i) {
    auto scene = parse_scene(json.at(i), job);
    if (!scene) return scene.error();
    job.scenes.push_back(std::move(*scene));
  }
  return {};
}

Result<void> parse_frame_member(const JsonAt& json, Job& job, const util::Limits& limits) {
  if (json.value().is_number()) {
    auto frame = json.integer(0, kLastFrame);
    if (!frame) return frame.error();
    job.frames = {*frame};
    return {};
  }
  if (!json.value().is_string()) return json.needs("an integer or a text such as \"1-120\"");
  auto frames = parse_frames(json.value().get<std::string>(), limits.max_views);
  if (!frames) {
    util::Error error = json.error(frames.error().message);
    error.exit = frames.error().exit;
    return error;
  }
  job.frames = std::move(*frames);
  return {};
}

Result<void> parse_animation(const JsonAt& json, Job& job) {
  if (json.value().is_number()) {
    auto index = json.integer(0, 1 << 24);
    if (!index) return index.error();
    job.animation = *index;
    return {};
  }
  auto name = json.text();
  if (!name) return name.error();
  job.animation = *name;
  return {};
}

Result<void> parse_size_member(const JsonAt& json, Job& job, const util::Limits& limits) {
  if (auto count = json.array(2, 2); !count) return count.error();
  std::array<std::uint32_t, 2> size{};
  for (std::size_t i = 0; i < 2; ++i) {
    auto pixels = json.at(i).integer(1, 0x7fffffff);
    if (!pixels) return pixels.error();
    size[i] = static_cast<std::uint32_t>(*pixels);
  }
  const std::uint64_t pixels = std::uint64_t{size[0]} * size[1];
  if (pixels > limits.max_image_pixels) {
    util::Error error = json.error(
        fmt::format("{} pixels, --max-image-pixels allows {}", pixels, limits.max_image_pixels));
    error.exit = util::Exit::limit;
    return error;
  }
  job.size = {size[0], size[1]};
  return {};
}

Result<void> parse_sky_member(const JsonAt& json, Job& job) {
  if (auto count = json.array(3, 3); !count) return count.error();
  for (int c = 0; c < 3; ++c) {
    auto value = json.at(static_cast<std::size_t>(c)).number(0.0, 3e38);
    if (!value) return value.error();
    job.params.sky[c] = static_cast<float>(*value);
  }
  return {};
}

Result<std::vector<std::string>> parse_aov_words(const JsonAt& json, render::AovSet& set) {
  auto count = json.array(1, 64);
  if (!count) return count.error();
  std::vector<std::string> words;
  for (std::size_t i = 0; i < *count; ++i) {
    const JsonAt item = json.at(i);
    auto text = item.text();
    if (!text) return text.error();
    auto named = text->find(',') == std::string::npos
                     ? render::parse_aovs(*text)
                     : Result<render::AovSet>(item.needs("one plane's name"));
    if (!named) {
      return item.needs(fmt::format("one of all, {}", render::aov_names()));
    }
    for (const render::AovInfo& info : render::aov_table()) {
      const auto bit = static_cast<std::size_t>(info.aov);
      if (!named->test(bit) || set.test(bit)) continue;
      set.set(bit);
      words.push_back(named->count() > 1 ? std::string(info.option) : *text);
    }
  }
  return words;
}

// What is read the same way as an option of `octrace render`.
Result<void> parse_looks(const JsonAt& json, Job& job, const util::Limits& limits) {
  const auto choice = [&](const char* key, std::uint32_t& into,
                          std::initializer_list<std::string_view> words) {
    return read_member(json, key, into, [&](const JsonAt& at) { return word(at, words); });
  };
  if (auto ok = choice("background", job.params.transparent_background, {"sky", "transparent"});
      !ok)
    return ok;
  if (auto ok = choice("cull", job.params.cull, {"none", "spec"}); !ok) return ok;
  if (auto ok = choice("alpha", job.params.alpha, {"ignore", "spec"}); !ok) return ok;
  std::uint32_t missing = 0;
  if (auto ok = choice("missing_images", missing, {"error", "warn"}); !ok) return ok;
  job.missing_images_warn = missing == 1;
  const auto most_spp =
      static_cast<std::int64_t>(std::min<std::uint64_t>(limits.max_spp, 1u << 30));
  if (auto ok = read_member(json, "spp", job.params.spp,
                            [&](const JsonAt& at) { return at.integer(1, most_spp); });
      !ok)
    return ok;
  if (auto ok = read_member(json, "seed", job.params.seed,
                            [](const JsonAt& at) { return at.integer(0, 0xffffffffll); });
      !ok)
    return ok;
  if (auto ok = read_member(json, "depth_scale", job.depth_scale,
                            [](const JsonAt& at) { return at.number(1e-6, 1e9); });
      !ok)
    return ok;
  if (json.has("sky")) {
    if (auto ok = parse_sky_member(json.at("sky"), job); !ok) return ok;
  }
  return {};
}

Result<void> parse_device_member(const JsonAt& json, Job& job) {
  auto text = json.text();
  if (!text) return text.error();
  if (!render::parse_device(*text)) return json.needs("auto, cpu, cuda or cuda:N");
  job.device = *text;
  return {};
}

Result<void> parse_compression(const JsonAt& json, Job& job) {
  auto chosen = word(json, {"none", "rle", "zips", "zip", "piz"});
  if (!chosen) return chosen.error();
  job.compression = json.value().get<std::string>();
  return {};
}

Result<void> parse_annotations(const JsonAt& json, Job& job) {
  const bool ids = job.aovs.test(static_cast<std::size_t>(kernels::Aov::object_id));
  job.objects = ids;
  if (auto ok =
          read_member(json, "objects", job.objects, [](const JsonAt& at) { return at.boolean(); });
      !ok)
    return ok;
  if (job.objects && !ids) return json.at("objects").error("needs \"object_id\" among \"aovs\"");
  if (!json.has("masks")) return {};
  auto chosen = word(json.at("masks"), {"coco", "coco_counts"});
  if (!chosen) return chosen.error();
  if (!job.objects) return json.at("masks").error("needs \"objects\", which needs \"object_id\"");
  job.coco_masks = true;
  job.coco_counts = *chosen == 1;
  return {};
}

}  // namespace

std::string path_beside(const std::string& folder, const std::string& path) {
  return path.starts_with('/') ? path : folder + path;
}

Result<Job> read_job(const std::string& path, const util::Limits& limits) {
  auto json = read_json_file(path, limits, util::Exit::usage);
  if (!json) return json.error();
  return parse_job(*json, path, limits);
}

Result<Job> parse_job(const Json& root, const std::string& path, const util::Limits& limits) {
  Job job;
  job.file = path;
  const std::size_t slash = path.rfind('/');
  job.folder = slash == std::string::npos ? "" : path.substr(0, slash + 1);
  const JsonAt json(root, path, util::Exit::usage);
  if (auto ok = json.object(
          {"version", "scenes",      "cameras",        "frames",      "fps",        "animation",
           "variant", "size",        "aovs",           "output",      "device",     "spp",
           "seed",    "sky",         "cull",           "alpha",       "background", "objects",
           "masks",   "depth_scale", "missing_images", "compression", "pack"},
          {"version", "scenes", "size", "aovs", "output"});
      !ok)
    return ok.error();
  if (auto version = json.at("version").integer(1, 1); !version) return version.error();
  if (auto ok = read_member(json, "variant", job.variant, parse_variant); !ok) return ok.error();
  if (auto ok = parse_scenes(json.at("scenes"), job); !ok) return ok.error();
  if (json.has("frames")) {
    if (auto ok = parse_frame_member(json.at("frames"), job, limits); !ok) return ok.error();
  }
  if (auto ok =
          read_member(json, "fps", job.fps, [](const JsonAt& at) { return at.number(1e-3, 1e6); });
      !ok)
    return ok.error();
  if (json.has("animation")) {
    if (auto ok = parse_animation(json.at("animation"), job); !ok) return ok.error();
  }
  if (auto ok = parse_size_member(json.at("size"), job, limits); !ok) return ok.error();
  auto words = parse_aov_words(json.at("aovs"), job.aovs);
  if (!words) return words.error();
  auto outputs = parse_outputs(json.at("output"), *words, job);
  if (!outputs) return outputs.error();
  job.outputs = std::move(*outputs);
  if (json.has("pack")) {
    auto pack = parse_pack(json.at("pack"));
    if (!pack) return pack.error();
    job.pack = std::move(*pack);
    for (const JobOutput& output : job.outputs) {
      const std::string& name = output.pattern.text();
      if (!name.starts_with('/') && !name.starts_with("..")) continue;
      return json.at("output").error("in a \"pack\" names are relative and stay in it");
    }
  }
  if (auto ok = parse_looks(json, job, limits); !ok) return ok.error();
  if (json.has("device")) {
    if (auto ok = parse_device_member(json.at("device"), job); !ok) return ok.error();
  }
  if (json.has("compression")) {
    if (auto ok = parse_compression(json.at("compression"), job); !ok) return ok.error();
  }
  if (auto ok = parse_annotations(json, job); !ok) return ok.error();
  if (!json.has("cameras")) {
    job.cameras = {AllCameras{}};
    return job;
  }
  auto cameras = parse_cameras(json.at("cameras"), job, limits);
  if (!cameras) return cameras.error();
  job.cameras = std::move(*cameras);
  return job;
}

}  // namespace octrace::batch
