// What main() knows of a command. To add one: a file command_NAME.cpp with a declare_NAME(), listed
// here and in main.cpp.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

#include "backend/util/result.h"

namespace octrace::app {

// Runs the command that the command line chose. A value other than ok is an outcome, not an error:
// "different" of a comparison, "partial" of a batch.
using Run = std::function<util::Result<util::Exit>()>;

// Each declares its options on the program's parser and sets `chosen` when its command is given.
void declare_render(CLI::App& program, Run& chosen);
void declare_info(CLI::App& program, Run& chosen);
void declare_compare(CLI::App& program, Run& chosen);
void declare_validate(CLI::App& program, Run& chosen);
void declare_export(CLI::App& program, Run& chosen);
void declare_batch(CLI::App& program, Run& chosen);
void declare_submit(CLI::App& program, Run& chosen);

}  // namespace octrace::app
