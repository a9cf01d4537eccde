#include "backend/batch/finish.h"

#include "backend/batch/results.h"
#include "backend/batch/state.h"
#include "backend/batch/summary.h"
#include "backend/util/atomic_file.h"

namespace octrace::batch {

util::Result<void> write_results(const Plan& plan, const RunOptions& options,
                                 const RunSummary& summary) {
  const std::string text =
      summary_json(plan, options, summary)
          .dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) +
      "\n";
  const bool divided = options.shard.count > 1;
  const auto write_summary = [&] {
    return util::write_file(
        divided ? shard_summary_path(plan.folder(), options.shard) : plan.folder() + "summary.json",
        text);
  };
  if (divided || summary.interrupted || summary.fatal) return write_summary();
  auto written = write_job_results(plan, [&](const JobResults&) { return write_summary(); });
  return written ? util::Result<void>() : written.error();
}

}  // namespace octrace::batch
