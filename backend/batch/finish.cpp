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
  if (!divided && !summary.interrupted && !summary.fatal) {
    if (auto written = write_job_results(plan); !written) return written.error();
  }
  // Last: who finds it finds the others, in the same folder, which this flushes.
  return util::write_file(
      divided ? shard_summary_path(plan.folder(), options.shard) : plan.folder() + "summary.json",
      text);
}

}  // namespace octrace::batch
