// octrace-bench paper: the experiment of the paper that this project grew from.
#include <fmt/format.h>

#include <cstdio>

#include "backend/render/device.h"
#include "backend/util/atomic_file.h"
#include "tests/bench/commands.h"
#include "tests/bench/paper.h"

namespace octrace::bench {

namespace {

struct Options {
  PaperOptions paper;
  std::string size = "800x600", device = "auto", json, svg;
};

int run(Options& options) {
  PaperOptions& paper = options.paper;
  if (!parse_size(options.size, &paper.width, &paper.height)) return 2;
  const util::Result<render::DeviceChoice> device = render::parse_device(options.device);
  if (!device) return fail(device.error());
  paper.gpu = device->kind != render::DeviceKind::cpu;
  paper.gpu_index = device->index;
  const util::Result<PaperResult> result = run_paper(paper);
  if (!result) return fail(result.error());
  fmt::print("{}", paper_text(*result));
  if (!options.svg.empty()) {
    const util::Result<void> written = util::write_file(options.svg, paper_svg(*result));
    if (!written) return fail(written.error());
  }
  return write_json(options.json, paper_json(*result));
}

}  // namespace

void add_paper_command(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("paper", "The seed paper's experiment: table 1 and figure 3");
  command->add_option("--size", options->size, "Size of the image, WxH")->capture_default_str();
  command->add_option("--repeats", options->paper.repeats, "Timed runs at each distance")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command->add_option("--band-rows", options->paper.band_rows, "Rows a launch of the seed's kernel")
      ->check(CLI::Range(1u, 65536u))
      ->capture_default_str();
  command->add_option("--threshold", options->paper.threshold, "Vertices a leaf of the seed's tree")
      ->check(CLI::Range(1u, 1000u))
      ->capture_default_str();
  command
      ->add_option("--device", options->device,
                   "auto, cuda or cuda:N: the CPU and the GPU; cpu: the CPU only")
      ->capture_default_str();
  command->add_option("--json", options->json, "Write the figures to this file");
  command->add_option("--svg", options->svg, "Draw figure 3 into this file");
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace octrace::bench
