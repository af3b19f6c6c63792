// SPDX-License-Identifier: GPL-2.0-or-later
// `bole reproduce` as its users run it, on a short simulated flight.
#include "run_bole.h"
#include "support/test.h"

namespace
{
using namespace bole::test;
using testing::HasSubstr;

/// A short simulated flight, of this name.
std::string simulated(const std::string &name)
{
  const std::string folder = freshFolder(name);
  EXPECT_EQ(run("simulate -o " + folder + " --seed 320 --samples 1 --frames 20 -q").status, 0);
  return folder;
}

TEST(Reproduce, PrintsTheStatisticsThatTheDetectorsThresholdsComeFrom)
{
  const Outcome outcome = run("reproduce --statistics " + simulated("statistics"));
  ASSERT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("mean gradient (Eq. 19), all lines"));
  EXPECT_THAT(outcome.text, HasSubstr("mean of 1 - p(background) (Eq. 20), all lines"));
  EXPECT_THAT(outcome.text, HasSubstr("minima of Eq. 3 next to near true trunks: "));
}

/// With alpha as printed the trees' views contradict each other by many standard deviations: the joint optimisation has
/// to bear that.
TEST(Reproduce, TellsTheFiguresOfThreeMethodsAndWhatIsDrawnAndStaysInTheWood)
{
  const std::string flight = simulated("short"), folder = freshFolder("figures");
  const Outcome outcome = run("reproduce " + flight + " -o " + folder + " -q");
  ASSERT_EQ(outcome.status, 0) << outcome.text;
  const std::string name = std::filesystem::path(flight).filename(), table = textOf(folder + "/table.csv");
  for (const char *method : {",\"paper, alpha 1000\"", ",\"paper, calibrated\"", ",default"})
    EXPECT_THAT(table, HasSubstr(name + method));
  EXPECT_EQ(linesIn(folder + "/table.csv"), 4u);
  std::istringstream path(textOf(folder + "/" + name + "/paper-1000/trajectory.tum"));
  int poses = 0;
  for (std::string line; std::getline(path, line);) {
    double stamp = 0, x = 0, y = 0, z = 0;
    if (std::istringstream(line) >> stamp >> x >> y >> z) {
      EXPECT_LT(std::abs(x) + std::abs(y) + std::abs(z), 30) << line;
      ++poses;
    }
  }
  EXPECT_EQ(poses, 20);
  const std::string drawn = folder + "/" + name + "/paper-calibrated";
  const auto json = jsonOf(drawn + "/figures.json");
  ASSERT_EQ(json["frames"].size(), 20u);
  EXPECT_GT(json["trunks"].size(), 5u);
  for (const char *picture : {"frame-00007.png", "saliency-00007.png"})
    EXPECT_GT(textOf(drawn + "/" + picture).size(), 500u) << picture;
  const Outcome figures = runShell(BOLE_SOURCE_DIR "/apps/campaign/figures.py " + folder);
  if (figures.text.find("No module named 'matplotlib'") != std::string::npos)
    GTEST_SKIP() << "python3-matplotlib is not installed";
  ASSERT_EQ(figures.status, 0) << figures.text;
  for (const char *figure : {"figure-5.svg", "figure-6.svg", "figure-7.svg", "figure-8.svg"})
    EXPECT_THAT(textOf(drawn + "/" + figure), HasSubstr("</svg>")) << figure;
}

TEST(Reproduce, SaysWhatItMustBeGiven)
{
  const Outcome outcome = run("reproduce");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.text, HasSubstr("-o FOLDER or --statistics FLIGHT"));
}
} // namespace
