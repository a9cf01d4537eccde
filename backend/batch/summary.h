// summary.json: what came of a run, for scripts (docs/batch.md).
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "backend/batch/plan.h"
#include "backend/batch/runner.h"

namespace octrace::batch {

nlohmann::ordered_json summary_json(const Plan& plan, const RunOptions& options,
                                    const RunSummary& summary);

// "scene 1 (b.glb): b.glb: IO_ERROR: ..." or "view 17: scene a, camera left, frame 3: ..."
std::string failure_text(const Plan& plan, const Failure& failure);

}  // namespace octrace::batch
