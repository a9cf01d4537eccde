// A job's outputs: which files a view has, and which planes each holds.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "backend/batch/job.h"

namespace octrace::batch {

namespace {

using util::Result;

struct Words {
  std::vector<std::string> words;
  render::AovSet set;
};

render::AovSet plane(const std::string& word) { return *render::parse_aovs(word); }

// The planes that an output names, from those of the job.
Result<Words> named_planes(const JsonAt& json, const Job& job) {
  auto count = json.array(1, 64);
  if (!count) return count.error();
  Words named;
  for (std::size_t i = 0; i < *count; ++i) {
    const JsonAt item = json.at(i);
    auto text = item.text();
    if (!text) return text.error();
    const auto set = render::parse_aovs(*text);
    if (!set || set->count() != 1 || (*set & ~job.aovs).any()) {
      return item.needs("one of the planes in \"aovs\"");
    }
    if ((named.set & *set).any()) continue;
    named.words.push_back(*text);
    named.set |= *set;
  }
  return named;
}

Result<JobOutput> parse_output(const JsonAt& json, const std::vector<std::string>& aovs,
                               const Job& job) {
  JsonAt path = json;
  Words words{aovs, job.aovs};
  const bool object = json.value().is_object();
  if (object) {
    if (auto ok = json.object({"path", "aovs"}, {"path"}); !ok) return ok.error();
    path = json.at("path");
    if (json.has("aovs")) {
      auto named = named_planes(json.at("aovs"), job);
      if (!named) return named.error();
      words = std::move(*named);
    }
  } else if (!json.value().is_string()) {
    return json.needs("a path pattern or an object");
  }
  auto text = path.text();
  if (!text) return text.error();
  // "out//a" and "out/./a" are the same place.
  auto pattern = OutputPattern::parse(std::filesystem::path(*text).lexically_normal().string());
  if (!pattern) return path.error(pattern.error().message);
  if (pattern->has(OutputPattern::Field::pack)) {
    return path.error("{pack} is for the path of \"pack\"");
  }
  JobOutput output{std::move(*pattern), words.words, {}};
  const auto add_file = [&](const std::optional<render::AovSet>& named) -> Result<void> {
    // A name before the tail: ".exr" alone would be a hidden file without extension.
    auto file = plan_file(fmt::format("x{}", output.pattern.tail()), named, words.set, job.size);
    if (!file) return path.error(file.error().message);
    if ((file->aovs & ~job.aovs).any()) {
      return path.error("this format holds one plane: name it in \"aovs\" beside \"path\"");
    }
    output.files.push_back(std::move(*file));
    return {};
  };
  if (!output.pattern.has_aov()) {
    const bool given = object && json.has("aovs");
    auto added = add_file(given ? std::optional(words.set) : std::nullopt);
    if (!added) return added.error();
    return output;
  }
  for (const std::string& word : words.words) {
    if (auto added = add_file(plane(word)); !added) return added.error();
  }
  return output;
}

}  // namespace

Result<JobPack> parse_pack(const JsonAt& json) {
  if (auto ok = json.object({"path", "views"}, {"path", "views"}); !ok) return ok.error();
  const JsonAt path = json.at("path");
  auto text = path.text();
  if (!text) return text.error();
  auto pattern = OutputPattern::parse(std::filesystem::path(*text).lexically_normal().string());
  if (!pattern) return path.error(pattern.error().message);
  using Field = OutputPattern::Field;
  const bool others = std::any_of(
      pattern->pieces().begin(), pattern->pieces().end(), [](const OutputPattern::Piece& piece) {
        return piece.field != Field::literal && piece.field != Field::pack;
      });
  if (others || !pattern->has(Field::pack)) {
    return path.error("needs the field {pack}, the pack's number, and takes no other");
  }
  if (!pattern->tail().ends_with(".tar")) return path.needs("a path that ends in .tar");
  auto views = json.at("views").integer(1, 1'000'000'000);
  if (!views) return views.error();
  return JobPack{std::move(*pattern), static_cast<std::uint64_t>(*views)};
}

Result<std::vector<JobOutput>> parse_outputs(const JsonAt& json,
                                             const std::vector<std::string>& aovs, const Job& job) {
  std::vector<JobOutput> outputs;
  if (json.value().is_array()) {
    auto count = json.array(1, 64);
    if (!count) return count.error();
    for (std::size_t i = 0; i < *count; ++i) {
      auto output = parse_output(json.at(i), aovs, job);
      if (!output) return output.error();
      outputs.push_back(std::move(*output));
    }
  } else {
    auto output = parse_output(json, aovs, job);
    if (!output) return output.error();
    outputs.push_back(std::move(*output));
  }
  render::AovSet homeless = job.aovs;
  for (const JobOutput& output : outputs) homeless &= ~needed_aovs(output.files);
  for (const std::string& word : aovs) {
    if ((plane(word) & homeless).none()) continue;
    return json.error(
        fmt::format("no output holds {}: use .exr or .npz, a pattern with {{aov}}, or an entry "
                    "{{\"path\": ..., \"aovs\": [\"{}\"]}}",
                    word, word));
  }
  return outputs;
}

}  // namespace octrace::batch
