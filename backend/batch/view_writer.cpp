#include "backend/batch/view_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <new>
#include <system_error>

#include "backend/batch/camera_choice.h"
#include "backend/batch/output.h"
#include "backend/batch/view_record.h"
#include "backend/util/grouped_commit.h"
#include "backend/util/interrupt.h"
#include "backend/util/log.h"
#include "backend/util/process.h"

namespace octrace::batch {

namespace {

using nlohmann::ordered_json;
using util::Result;

// Lines since the last flush are lost by a power cut, and their views rendered again.
constexpr double kFlushSeconds = 1.0;
constexpr std::uint64_t kFramebufferBytes = 2ull << 30;  // of all framebuffers, but for two
// Of those that are filled before the first view is written: the image library is still loading.
constexpr std::uint64_t kFirstBytes = 32ull << 20, kMostFirst = 8;

struct FramebufferCounts {
  std::size_t steady, first;
};

FramebufferCounts framebuffer_counts(const Plan& plan, unsigned threads) {
  std::uint64_t channels = 0;
  for (const render::AovInfo& info : render::aov_table()) {
    if (plan.needed_aovs().test(static_cast<std::size_t>(info.aov))) {
      channels += static_cast<std::uint64_t>(info.channel_count);
    }
  }
  const ImageSize& size = plan.job().size;
  const std::uint64_t bytes =
      std::max<std::uint64_t>(std::uint64_t{size.width} * size.height * channels * 4, 1);
  const std::uint64_t steady =
      std::clamp<std::uint64_t>(kFramebufferBytes / bytes, 2, std::uint64_t{threads} + 2);
  const std::uint64_t first = std::max(steady, std::min(kFirstBytes / bytes, kMostFirst));
  return {static_cast<std::size_t>(steady), static_cast<std::size_t>(first)};
}

// zlib's level 1, as a single render has it: level 4 takes longer and saves little.
std::string codec(const std::string& compression) {
  return compression.starts_with("zip") ? compression + ":1" : compression;
}

ordered_json error_json(const util::Error& error) {
  return {{"exit", static_cast<int>(error.exit)},
          {"code", error.code},
          {"file", error.file},
          {"pointer", error.pointer},
          {"message", error.message}};
}

}  // namespace

ViewWriter::ViewWriter(const Plan& plan, Journal& journal, unsigned threads, std::uint64_t views,
                       std::function<void()> report)
    : plan_(plan), journal_(journal), report_(std::move(report)) {
  if (plan.job().pack) {
    auto scratch = ScratchFolder::create();
    if (!scratch) {
      outcome_.fatal = scratch.error();
      return;
    }
    scratch_.emplace(std::move(*scratch));
    packs_.emplace(plan, [this](const ordered_json& line) { return note(line); });
  }
  const FramebufferCounts counts = framebuffer_counts(plan, threads);
  // Two more than processors: some wait for the disk, and then they hold no framebuffer.
  const std::uint64_t writers = std::min<std::uint64_t>(std::uint64_t{threads} + 2, views);
  // All at once: were they made when first needed, a late moment of slow writing would add one, and
  // memory would grow with the number of views.
  const ImageSize& size = plan.job().size;
  for (std::uint64_t i = 0; i < std::min<std::uint64_t>(counts.first, views); ++i) {
    free_.push_back(
        std::make_unique<render::Framebuffer>(size.width, size.height, plan.needed_aovs()));
  }
  spare_ = free_.size() - std::min(counts.steady, free_.size());
  for (std::uint64_t i = 0; i < writers; ++i) {
    try {
      threads_.emplace_back([this] { work(); });
    } catch (const std::system_error&) {  // no more threads are to be had
      if (threads_.empty()) throw;
      break;
    }
  }
}

ViewWriter::~ViewWriter() { finish(); }

std::unique_ptr<render::Framebuffer> ViewWriter::acquire() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return outcome_.fatal || free_.size() > (writing_ ? spare_ : 0); });
  if (outcome_.fatal) return nullptr;
  auto framebuffer = std::move(free_.back());
  free_.pop_back();
  return framebuffer;
}

void ViewWriter::give_back(std::unique_ptr<render::Framebuffer> framebuffer) {
  const std::lock_guard lock(mutex_);
  writing_ = true;
  if (closed_) return;  // freed once the lock is, beside other views that are still written
  free_.push_back(std::move(framebuffer));
  changed_.notify_all();
}

void ViewWriter::submit(TracedView view) {
  const std::lock_guard lock(mutex_);
  queue_.push_back(std::move(view));
  changed_.notify_all();
}

void ViewWriter::finish() {
  if (threads_.empty()) return;
  {
    std::vector<std::unique_ptr<render::Framebuffer>> unused;
    const std::lock_guard lock(mutex_);
    closed_ = true;
    unused.swap(free_);
    changed_.notify_all();
  }
  for (std::thread& thread : threads_) thread.join();
  threads_.clear();
  {
    const std::lock_guard lock(journal_mutex_);
    flush_folders();  // the journal is flushed after its last line
  }
  if (!packs_) return;
  const std::lock_guard lock(mutex_);
  outcome_.done = packs_->done();
  packs_.reset();
}

bool ViewWriter::stopped() const {
  const std::lock_guard lock(mutex_);
  return outcome_.fatal.has_value();
}

ViewWriter::Outcome ViewWriter::outcome() const {
  const std::lock_guard lock(mutex_);
  return outcome_;
}

void ViewWriter::work() {
  for (;;) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return closed_ || !queue_.empty(); });
    if (queue_.empty()) return;
    TracedView view = std::move(queue_.front());
    queue_.pop_front();
    const bool stop = outcome_.fatal.has_value();
    lock.unlock();
    if (!stop && !util::interrupt_flag()) write(view);
    if (view.framebuffer) give_back(std::move(view.framebuffer));
  }
}

void ViewWriter::write(TracedView& view) {
  const util::Timer timer;
  double flush_ms = 0.0;
  std::vector<PackMember> members;
  Result<ordered_json> made = encode(view, members, flush_ms);
  const double write_ms = timer.milliseconds();
  if (made && !scratch_) {
    if (auto measured = measure_files(*made); !measured) made = measured.error();
  }
  if (!made) {
    if (util::interrupt_flag()) return;  // dropped: the next run makes it
    if (made.error().exit == util::Exit::io) return stop(made.error());
    return fail({view.view.index, view.view.scene, 1, made.error()});
  }
  ordered_json& line = *made;
  line["ms"] = {view.trace_ms, write_ms};
  if (auto kept = keep(line, std::move(members)); !kept) {
    if (util::interrupt_flag()) return;
    return stop(kept.error());
  }
  {
    const std::lock_guard lock(mutex_);
    ++outcome_.done;
    outcome_.encode_ms += write_ms - flush_ms;
    outcome_.flush_ms += flush_ms;
  }
  const std::lock_guard lock(report_mutex_);
  report_();
}

// The view's line of the journal, once its files have their names.
Result<ordered_json> ViewWriter::encode(TracedView& view, std::vector<PackMember>& members,
                                        double& flush_ms) {
  // Members of packs are no files of their own.
  util::GroupedCommit group(scratch_ ? util::GroupedCommit::When::at_once
                                     : util::GroupedCommit::When::by_finish);
  auto line = [&]() -> Result<ordered_json> {
    try {
      auto files = write_files(view, members);
      if (!files) return files;
      return view_line(view, std::move(*files));
    } catch (const std::bad_alloc&) {
      return util::Error{util::Exit::limit, "", "out of memory", "", ""};
    }
  }();
  // The next view may be traced while this one waits for the disk.
  give_back(std::move(view.framebuffer));
  if (line) {
    if (auto committed = group.finish(); !committed) return committed.error();
  }
  flush_ms = group.milliseconds();
  return line;
}

ordered_json ViewWriter::view_line(const TracedView& view, ordered_json files) const {
  ordered_json line = {{"kind", "view"},
                       {"view", view.view.index},
                       {"scene", view.view.scene},
                       {"name", plan_.job().scenes[view.view.scene].name},
                       {"camera", view.camera.name},
                       {"frame", view.view.frame}};
  if (!plan_.job().frames.empty()) line["time"] = view.view.time;
  line["size"] = {view.framebuffer->width(), view.framebuffer->height()};
  line["files"] = std::move(files);
  line["lens"] = ordered_json::parse(camera_json(view.camera));
  if (plan_.job().objects) {
    const render::Framebuffer& image = *view.framebuffer;
    line["objects"] =
        objects_record(find_objects(image.uints(kernels::Aov::object_id), image.width(),
                                    image.height(), plan_.job().coco_masks));
  }
  return line;
}

// The sizes of the line's files, which have their names by now.
Result<void> ViewWriter::measure_files(ordered_json& line) {
  for (ordered_json& file : line["files"]) {
    const std::string path = plan_.folder() + file["path"].get<std::string>();
    std::error_code error;
    file["bytes"] = std::filesystem::file_size(path, error);
    if (error) return util::Error{util::Exit::io, "IO_ERROR", error.message(), path, ""};
    const std::lock_guard lock(journal_mutex_);
    unflushed_folders_.insert(path.substr(0, path.rfind('/') + 1));
  }
  return {};
}

// The files are complete: the journal says so, or the pack does once it is whole.
Result<void> ViewWriter::keep(const ordered_json& line, std::vector<PackMember> members) {
  if (!packs_) return note(line);
  auto description = pack_description(line);
  if (!description) return description.error();
  members.push_back(std::move(*description));
  return packs_->add(line.at("view").get<std::uint64_t>(), std::move(members));
}

Result<ordered_json> ViewWriter::write_files(const TracedView& view,
                                             std::vector<PackMember>& members) {
  // Without the camera, which the journal keeps: the image library never frees a text that it was
  // given once (OIIO::ustring), and a text for each view is 0.7 kB a view for ever.
  Metadata metadata = view_metadata(plan_.job().scenes[view.view.scene].source, view.camera);
  std::erase_if(metadata, [](const auto& entry) { return entry.first == "octrace:camera"; });
  // The image library takes the codec as an attribute, which goes before the writer's own choice.
  Metadata exr_metadata = metadata;
  exr_metadata.emplace_back("compression", codec(plan_.job().compression));
  ordered_json files = ordered_json::array();
  for (Output& file : plan_.files(view.view)) {
    const std::string name = file.path;
    const std::string folder = name.substr(0, name.rfind('/') + 1);
    warn_of_depth(file, *view.framebuffer);
    if (scratch_) {
      file.path = fmt::format("{}{}-{}{}", scratch_->path(), view.view.index, members.size(),
                              std::filesystem::path(name).extension().string());
    }
    const auto write = [&] {
      return write_output(file, *view.framebuffer, plan_.job().depth_scale,
                          file.kind == FileKind::exr ? exr_metadata : metadata);
    };
    auto written = write();
    if (!written && written.error().exit == util::Exit::io &&
        !std::filesystem::exists(std::filesystem::path(file.path).parent_path())) {
      // The first file of its folder.
      if (auto made = make_folder(folder); !made) return made.error();
      written = write();
    }
    if (!written) return written.error();
    if (scratch_) {
      auto content = take_file(file.path);
      if (!content) return content.error();
      files.push_back({{"path", name}, {"bytes", content->size()}});
      members.push_back({name, std::move(*content)});
      continue;
    }
    files.push_back({{"path", file.path.substr(plan_.folder().size())}, {"bytes", 0}});
  }
  return files;
}

// Once: what is true of one view is true of many.
void ViewWriter::warn_of_depth(const Output& file, const render::Framebuffer& framebuffer) {
  if (depth_warned_.test()) return;
  const auto warning = depth_warning(file, framebuffer, plan_.job().depth_scale);
  if (!warning || depth_warned_.test_and_set()) return;
  util::log_warning(fmt::format("{} (other views are not named)", *warning));
}

void ViewWriter::note_scene(const ordered_json& line) {
  if (auto noted = note(line); !noted) stop(noted.error());
}

void ViewWriter::skip(std::uint64_t view) {
  if (!packs_) return;
  if (auto skipped = packs_->skip(view); !skipped) stop(skipped.error());
}

void ViewWriter::fail(Failure failure) {
  if (failure.view) skip(*failure.view);
  ordered_json line = {{"kind", "fail"}};
  if (failure.view) line["view"] = *failure.view;
  line["scene"] = failure.scene;
  line["views"] = failure.views;
  line["error"] = error_json(failure.error);
  if (auto noted = note(line); !noted) stop(noted.error());
  {
    const std::lock_guard lock(mutex_);
    outcome_.failed += failure.views;
    if (outcome_.failures.size() < RunSummary::kMostFailures) {
      outcome_.failures.push_back(std::move(failure));
    }
  }
  const std::lock_guard lock(report_mutex_);
  report_();
}

Result<void> ViewWriter::note(const ordered_json& line) {
  const std::string text = line.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
  const std::lock_guard lock(journal_mutex_);
  if (auto appended = journal_.append(text); !appended) return appended;
  if (since_flush_.seconds() < kFlushSeconds) return {};
  return flush();
}

// The files' content was flushed before they were renamed, so a line whose file's name is lost by a
// power cut is one of a missing file, which the next run notices.
Result<void> ViewWriter::flush() {
  flush_folders();
  since_flush_ = util::Timer();
  return journal_.flush();
}

void ViewWriter::flush_folders() {
  for (const std::string& folder : unflushed_folders_) util::flush_folder(folder);
  unflushed_folders_.clear();
}

void ViewWriter::stop(const util::Error& error) {
  const std::lock_guard lock(mutex_);
  if (!outcome_.fatal) outcome_.fatal = error;
  changed_.notify_all();
}

}  // namespace octrace::batch
