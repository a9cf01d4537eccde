// The commands of octrace-bench, one file each.
#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <string>

#include "backend/util/result.h"

namespace octrace::bench {

void add_rays_command(CLI::App& app, int& exit_code);
void add_build_command(CLI::App& app, int& exit_code);
void add_growth_command(CLI::App& app, int& exit_code);
void add_paper_command(CLI::App& app, int& exit_code);
void add_about_command(CLI::App& app, int& exit_code);

int fail(const util::Error& error);  // prints it; returns its exit code
int write_json(const std::string& path, const nlohmann::json& rows);  // nothing where path is empty
// "WxH", both at least 1; says so where it is not.
bool parse_size(const std::string& text, int* width, int* height);

}  // namespace octrace::bench
