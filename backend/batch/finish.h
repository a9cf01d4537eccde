// What a run leaves beside the images: its summary, and, where the job was not divided, the files
// made from the journals.
#pragma once

#include "backend/batch/plan.h"
#include "backend/batch/runner.h"

namespace octrace::batch {

// Exit 5.
util::Result<void> write_results(const Plan& plan, const RunOptions& options,
                                 const RunSummary& summary);

}  // namespace octrace::batch
