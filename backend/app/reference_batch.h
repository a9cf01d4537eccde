// Exports views of scenes and has POV-Ray and Blender render them, several at once.
#pragma once

#include <chrono>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "backend/app/options.h"
#include "backend/scene/scene.h"
#include "exporters/blender/blender.h"
#include "validation/reference/reference.h"
#include "validation/reference/scratch.h"

namespace octrace::app {

struct ReferenceOptions {
  std::string povray, blender;        // programs; empty: not wanted
  std::chrono::seconds timeout{120};  // for one scene
  unsigned jobs = 1;                  // programs that run at once
  unsigned threads = 0;               // of all of them together; 0: the machine's
  ImageSize size;
  bool cull = true, alpha = true;
  util::Limits limits;
};

// What the programs saw of one view; empty where a program was not wanted.
struct ReferenceView {
  std::optional<util::Result<validation::Planes>> povray, blender;
  std::vector<std::string> povray_notes;  // what POV-Ray cannot show as octrace does
};

class ReferenceBatch {
 public:
  static util::Result<ReferenceBatch> create(const ReferenceOptions& options);

  // Exports now, so that the scene need not stay. Blender reads the file itself, with its own
  // importer, and evaluates an animation itself; a built-in scene is exported to glTF for it.
  util::Result<void> add(const SceneRequest& request, const scene::Scene& scene,
                         std::span<const scene::Camera> cameras);
  std::size_t views() const { return views_.size(); }

  // In the order in which the views were added.
  std::vector<ReferenceView> run();

 private:
  struct BlenderEntry {
    exporters::BlenderScene scene;
    std::size_t first_view;
  };
  ReferenceBatch(const ReferenceOptions& options, validation::Scratch scratch)
      : options_(options), scratch_(std::move(scratch)) {}
  validation::ProgramOptions program(const std::string& path) const;
  void run_blender(std::span<const BlenderEntry> entries, const std::string& name);
  void run_povray(std::size_t view);

  ReferenceOptions options_;
  validation::Scratch scratch_;
  std::vector<ReferenceView> views_;
  std::vector<std::optional<validation::PovrayJob>> povray_jobs_;  // by view
  std::vector<BlenderEntry> blender_entries_;
};

}  // namespace octrace::app
