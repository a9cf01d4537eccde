// The far end of a batch: encodes and writes traced views on threads of their own, and notes each
// in the journal once its files are complete.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "backend/batch/journal.h"
#include "backend/batch/pack_writer.h"
#include "backend/batch/plan.h"
#include "backend/batch/runner.h"
#include "backend/batch/scratch_folder.h"
#include "backend/batch/state.h"
#include "backend/render/framebuffer.h"
#include "backend/util/process.h"

namespace octrace::batch {

struct TracedView {
  View view;
  scene::Camera camera;
  std::unique_ptr<render::Framebuffer> framebuffer;
  double trace_ms = 0.0;
};

class ViewWriter {
 public:
  // `report` is called after every view, by one thread at a time.
  // `views` is how many will come at most.
  ViewWriter(const Plan& plan, Journal& journal, unsigned threads, std::uint64_t views,
             std::function<void()> report);
  ~ViewWriter();  // finishes
  ViewWriter(const ViewWriter&) = delete;
  ViewWriter& operator=(const ViewWriter&) = delete;

  // A framebuffer of the job's size; waits while all are in use, which bounds how far tracing runs
  // ahead. Null: the run is to stop.
  std::unique_ptr<render::Framebuffer> acquire();
  void give_back(std::unique_ptr<render::Framebuffer> framebuffer);
  void submit(TracedView view);

  void note_scene(const nlohmann::ordered_json& line);  // before the scene's views
  void fail(Failure failure);
  void skip(std::uint64_t view);  // of a scene that failed: a pack will lack it
  void finish();                  // returns when all that was submitted is done

  bool stopped() const;
  struct Outcome {
    std::uint64_t done = 0, failed = 0;
    std::vector<Failure> failures;
    std::optional<util::Error> fatal;
    double encode_ms = 0.0, flush_ms = 0.0;  // of all writers together
  };
  Outcome outcome() const;  // also while running

 private:
  void work();
  void write(TracedView& view);
  void warn_of_depth(const Output& file, const render::Framebuffer& framebuffer);
  // Of a packed job the files end up in `members`.
  util::Result<nlohmann::ordered_json> write_files(const TracedView& view,
                                                   std::vector<PackMember>& members);
  util::Result<nlohmann::ordered_json> encode(TracedView& view, std::vector<PackMember>& members,
                                              double& flush_ms);
  nlohmann::ordered_json view_line(const TracedView& view, nlohmann::ordered_json files) const;
  util::Result<void> measure_files(nlohmann::ordered_json& line);
  util::Result<void> keep(const nlohmann::ordered_json& line, std::vector<PackMember> members);
  util::Result<void> note(const nlohmann::ordered_json& line);
  // With journal_mutex_ held.
  util::Result<void> flush();
  void flush_folders();
  void stop(const util::Error& error);

  const Plan& plan_;
  Journal& journal_;
  std::optional<ScratchFolder> scratch_;  // where members of packs are encoded
  std::optional<PackWriter> packs_;
  std::function<void()> report_;

  mutable std::mutex mutex_;  // of all below
  std::condition_variable changed_;
  std::deque<TracedView> queue_;
  std::vector<std::unique_ptr<render::Framebuffer>> free_;
  std::atomic_flag depth_warned_;
  // Framebuffers that are not used any more once the first one has come back.
  std::size_t spare_ = 0;
  bool writing_ = false;
  bool closed_ = false;
  Outcome outcome_;

  std::mutex journal_mutex_, report_mutex_;
  std::set<std::string> unflushed_folders_;  // journal_mutex_'s: of files that the journal tells of
  util::Timer since_flush_;
  std::vector<std::thread> threads_;
};

}  // namespace octrace::batch
