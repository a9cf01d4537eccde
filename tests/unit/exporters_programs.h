// Other programs, run as a user would run them.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "exporters/povray/povray.h"
#include "tests/unit/exporters_ray_caster.h"

namespace octrace::test {

bool installed(const std::string& program);

// Runs `program arguments...` in `folder`, with everything it prints in folder/program.log. The
// exit code.
int run_in(const std::string& folder, const std::string& program,
           const std::vector<std::string>& arguments);

// Exports to `folder`, renders with POV-Ray, decodes.
std::vector<Sight> through_povray(const scene::Scene& scene, const scene::Camera& camera,
                                  const exporters::PovrayOptions& options,
                                  const std::string& folder);

// The same surfaces at the same depths: at most `slack` pixels may differ in what they show, and no
// depth of the rest by more than `error`, relative. Where neither shows anything they agree.
void expect_same_sight(const std::vector<Sight>& expected, const std::vector<Sight>& actual,
                       int width, int slack, double error);

}  // namespace octrace::test
