// Options that several commands share.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "backend/batch/output.h"
#include "backend/batch/scene_session.h"
#include "backend/util/limits.h"

namespace octrace::app {

using batch::ImageSize;
using batch::SceneRequest;
using batch::SceneSession;
using batch::usage_error;

// SCENE, --scene, --variant, --missing-images, --builder, --leaf, --threads, --verify, --max-...
void add_scene_options(CLI::App& command, SceneRequest& request);
void add_limit_options(CLI::App& command, util::Limits& limits);
void add_views_limit(CLI::App& command, util::Limits& limits);  // --max-views
// --builder, --leaf, --verify
void add_tuning_options(CLI::App& command, octree::BuildOptions& build, bool& verify);
void add_verbosity_options(CLI::App& command);  // --quiet, --verbose

// An option that takes one of a few words.
template <class T>
CLI::Option* add_choice(CLI::App& command, const std::string& name, T& value,
                        std::vector<std::pair<std::string, T>> choices, const std::string& help) {
  std::string words;
  for (const auto& choice : choices) words += (words.empty() ? "" : "|") + choice.first;
  const auto choose = [&value, choices = std::move(choices), name, words](const std::string& word) {
    for (const auto& choice : choices) {
      if (choice.first != word) continue;
      value = choice.second;
      return;
    }
    throw CLI::ValidationError(name, "takes " + words + ", not '" + word + "'");
  };
  return command.add_option_function<std::string>(name, choose, help)->type_name(words);
}

// "640x480". Usage errors; exit 6 past --max-image-pixels.
util::Result<ImageSize> parse_size(const std::string& text, const util::Limits& limits);

}  // namespace octrace::app
