#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/driver.h"

namespace octrace::test {
namespace {

using ::testing::HasSubstr;

TEST(Help, EveryCommandExplainsItself) {
  const Outcome program = run({"--help"});
  EXPECT_EQ(program.exit_code, 0);
  EXPECT_THAT(program.out, HasSubstr("Examples:"));
  EXPECT_THAT(program.out, HasSubstr("Exit codes:"));
  EXPECT_EQ(program.err, "");
  for (const char* command : {"render", "info"}) {
    EXPECT_THAT(program.out, HasSubstr(command));
    const Outcome help = run({command, "--help"});
    EXPECT_EQ(help.exit_code, 0);
    EXPECT_THAT(help.out, HasSubstr("Examples:"));
    EXPECT_THAT(help.out, HasSubstr("SCENE"));
  }
}

TEST(Help, VersionIsOneLine) {
  const Outcome outcome = run({"--version"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.out, ::testing::MatchesRegex("octrace [0-9]+\\.[0-9]+\\.[0-9]+\n"));
}

// What no image is needed for must not load the image library, whose loading takes longer than
// the rest of the program together.
TEST(Help, NeedsNoImageLibrary) {
  Scratch scratch;
  std::filesystem::copy_file(OCTRACE_PROGRAM, scratch.path("octrace"));  // without its module
  Launch launch;
  launch.program = scratch.path("octrace");
  launch.arguments = {"info", "builtin:paper"};
  EXPECT_EQ(run(launch).exit_code, 0);
  launch.arguments = {"render", "builtin:paper", "--size", "8x8", "-o", scratch.path("a.exr")};
  const Outcome outcome = run(launch);
  EXPECT_EQ(outcome.exit_code, 5);
  EXPECT_THAT(outcome.err, HasSubstr("liboctrace_image.so"));
}

TEST(CommandLine, SaysWhatIsNoCommandAndWhatIsNotExpected) {
  const Outcome command = run({"rendr", "builtin:paper"});
  EXPECT_EQ(command.exit_code, 2);
  EXPECT_THAT(command.err, HasSubstr("\"rendr\" is no command; there are render, info"));
  const Outcome option = run({"info", "builtin:paper", "--szie", "10x10"});
  EXPECT_EQ(option.exit_code, 2);
  EXPECT_THAT(option.err, HasSubstr("not expected: --szie 10x10"));
}

TEST(CommandLine, SaysThatAFolderIsMissing) {
  Scratch scratch;
  const Outcome outcome =
      run({"render", "builtin:paper", "-o", scratch.path("no/a.npy"), "--aov", "Z"});
  EXPECT_EQ(outcome.exit_code, 5);
  EXPECT_THAT(outcome.err, HasSubstr("there is no folder " + scratch.path("no")));
}

TEST(CommandLine, WarnsOfDepthThatSixteenBitsCannotHold) {
  Scratch scratch;
  const auto render = [&](const char* scale) {
    return run({"render", "builtin:paper", "-o", scratch.path("a.png"), "--aov", "Z", "--size",
                "32x24", "--depth-scale", scale});
  };
  EXPECT_THAT(render("1e9").err, HasSubstr("of 1"));
  EXPECT_THAT(render("1e9").err, HasSubstr("pixels that show something lie beyond"));
  EXPECT_THAT(render("0.001").err, ::testing::Not(HasSubstr("warning")));
}

struct Wrong {
  std::vector<std::string> arguments;
  std::string said;
  int exit_code = 2;
};

class WrongCommandLine : public ::testing::TestWithParam<Wrong> {};

TEST_P(WrongCommandLine, IsNamedBeforeAnyWork) {
  Scratch scratch;
  Launch launch;
  launch.arguments = GetParam().arguments;
  launch.folder = scratch.folder();
  const Outcome outcome = run(launch);
  EXPECT_EQ(outcome.exit_code, GetParam().exit_code) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr(GetParam().said));
  EXPECT_EQ(outcome.out, "");
  EXPECT_TRUE(scratch.files().empty());
}

Wrong render(const std::vector<std::string>& more, const std::string& said, int exit_code = 2) {
  std::vector<std::string> arguments = {"render", "builtin:paper", "-o", "a.exr"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return {arguments, said, exit_code};
}

INSTANTIATE_TEST_SUITE_P(
    Program, WrongCommandLine,
    ::testing::Values(Wrong{{}, "a command is required"}, Wrong{{"frobnicate"}, "frobnicate"},
                      Wrong{{"render"}, "SCENE"}, Wrong{{"info"}, "SCENE"},
                      Wrong{{"render", "builtin:paper"}, "--output"},
                      Wrong{{"render", "builtin:paper", "extra", "-o", "a.exr"}, "extra"},
                      Wrong{{"info", "builtin:nope"}, "nope"},
                      Wrong{{"info", "builtin:paper", "--scene", "-1"}, "--scene"}));

INSTANTIATE_TEST_SUITE_P(
    Outputs, WrongCommandLine,
    ::testing::Values(Wrong{{"render", "builtin:paper", "-o", "a.bmp"}, ".exr"},
                      Wrong{{"render", "builtin:paper", "-o", "a"}, ".exr"},
                      Wrong{{"render", "builtin:paper", "-o", "a.png:P"}, "floating point"},
                      Wrong{{"render", "builtin:paper", "-o", "a.jpg:Z"}, "16 bits"},
                      Wrong{{"render", "builtin:paper", "-o", "a.png:Z,mask"}, "one AOV"},
                      Wrong{{"render", "builtin:paper", "-o", "a.png:nope"}, "nope"},
                      Wrong{{"render", "builtin:paper", "-o", "a.png", "--aov", "Z,mask"},
                            "--aov asks for"},
                      render({"-o", "./a.exr"}, "named twice"), render({"--aov", "nope"}, "nope"),
                      render({"--aov", ""}, "--aov")));

INSTANTIATE_TEST_SUITE_P(
    Values, WrongCommandLine,
    ::testing::Values(
        render({"--size", "0x5"}, "--size"), render({"--size", "5"}, "--size"),
        render({"--size", "5x"}, "--size"), render({"--size", "-5x5"}, "--size"),
        render({"--size", "5x5x5"}, "--size"), render({"--size", "4294967297x1"}, "--size"),
        render({"--spp", "0"}, "--spp"), render({"--spp", "-1"}, "--spp"),
        render({"--spp", "2.5"}, "--spp"), render({"--spp", "4294967297"}, "--spp"),
        render({"--seed", "x"}, "--seed"), render({"--threads", "-1"}, "--threads"),
        render({"--threads", "99999"}, "--threads"), render({"--leaf", "0"}, "--leaf"),
        render({"--tile", "0"}, "--tile"), render({"--scene", "3"}, "--scene"),
        render({"--sky", "1,2"}, "--sky"), render({"--sky", "1,2,3,4"}, "--sky"),
        render({"--sky", "1,2,nan"}, "--sky"), render({"--sky", "1,2,-3"}, "--sky"),
        render({"--depth-scale", "0"}, "--depth-scale"),
        render({"--depth-scale", "inf"}, "--depth-scale"), render({"--camera", "nobody"}, "nobody"),
        render({"--camera", "99"}, "there is no such camera"),
        render({"--max-triangles", "many"}, "--max-triangles"),
        render({"--nonsense"}, "--nonsense")));

INSTANTIATE_TEST_SUITE_P(Words, WrongCommandLine,
                         ::testing::Values(render({"--device", "gpu"}, "auto, cpu, cuda"),
                                           render({"--builder", "bvh"}, "median|sah|quality"),
                                           render({"--cull", "1"}, "spec|none"),
                                           render({"--alpha", "x"}, "spec|ignore"),
                                           render({"--background", "red"}, "sky|transparent"),
                                           render({"--missing-images", "no"}, "error|warn"),
                                           render({"--progress", "yes"}, "auto|bar|json|none"),
                                           render({"--quiet", "--verbose"}, "--quiet")));

TEST(Failure, FileThatIsNotThere) {
  const Outcome outcome = run({"info", "/nonexistent/scene.glb"});
  EXPECT_EQ(outcome.exit_code, 5);
  EXPECT_THAT(outcome.err, HasSubstr("octrace: error: /nonexistent/scene.glb: "));
}

TEST(Failure, ResultsThatCannotBeWritten) {
  Launch launch;
  launch.arguments = {"info", "builtin:paper", "--json"};
  launch.out_path = "/dev/full";
  const Outcome outcome = run(launch);
  EXPECT_EQ(outcome.exit_code, 5);
  EXPECT_THAT(outcome.err, HasSubstr("standard output"));
}

}  // namespace
}  // namespace octrace::test
