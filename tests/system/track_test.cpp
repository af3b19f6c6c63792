// SPDX-License-Identifier: GPL-2.0-or-later
// The command as its users run it: a whole flight, and their mistakes.
#include "run_bole.h"
#include "support/test.h"

#include <regex>

namespace
{
namespace fs = std::filesystem;
using namespace bole::test;
using testing::HasSubstr;

TEST(Track, MapsAPlainVideoAndSaysWhereItsMetreComesFrom)
{
  const std::string folder = freshFolder("plain");
  ASSERT_EQ(run("track " + kFlight + " -o " + folder + " --no-video --odometry none --frames 60").status, 0);
  const auto summary = jsonOf(folder + "/summary.json");
  EXPECT_EQ(summary.at("scale"), "prior");
  EXPECT_GT(summary.at("scale_sigma"), 0.05);
  EXPECT_EQ(summary.at("gravity"), "trunks");
  EXPECT_EQ(summary.at("ranges"), true);
  EXPECT_THAT(textOf(folder + "/map.svg"), HasSubstr("scale: prior on the radius"));
  const Outcome table = run("evaluate " + folder + " " + kFlight);
  ASSERT_EQ(table.status, 0);
  EXPECT_THAT(table.text, HasSubstr("scale: prior on the radius"));
  EXPECT_THAT(table.text, HasSubstr("x, y, yaw and scale"));
  const auto evaluation = jsonOf(folder + "/evaluation.json");
  const auto &path = evaluation.at("trajectory").at("smoothed");
  EXPECT_LT(path.at("ate").at("xy_yaw_scale").at("rmse_m"), 0.02 * 6); // 60 frames fly more than 6 m
  EXPECT_NEAR(std::log(path.at("scale").get<double>()), 0, 0.8);       // the prior knows it to a factor of 1.6
}

TEST(Track, AKnownHeightOfTheCameraIsTheMetreOfAPlainVideo)
{
  const std::string folder = freshFolder("height");
  ASSERT_EQ(
      run("track " + kFlight + " -o " + folder + " --no-video --odometry none --camera-height 1.5 --frames 60").status,
      0);
  const auto summary = jsonOf(folder + "/summary.json");
  EXPECT_EQ(summary.at("scale"), "height");
  ASSERT_EQ(run("evaluate " + folder + " " + kFlight).status, 0);
  const auto evaluation = jsonOf(folder + "/evaluation.json");
  EXPECT_NEAR(evaluation.at("trajectory").at("smoothed").at("scale").get<double>(), 1, 0.25);
}

TEST(Track, ShowsItsOverlayInAWindow)
{
  if (std::system("command -v xvfb-run >/dev/null") != 0)
    GTEST_SKIP() << "xvfb-run is not installed";
  const std::string folder = freshFolder("show");
  const Outcome outcome = run("track " + kFlight + " -o " + folder + " --frames 15 --no-video --show", "xvfb-run -a ");
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_TRUE(fs::exists(folder + "/trunks.csv"));
}

TEST(Track, SaysThatThereIsNoDisplayToShowItOn)
{
  const Outcome outcome = run(
      "track " + kFlight + " -o " + freshFolder("no_display") + " --frames 15 --no-video --show", "env -u DISPLAY ");
  EXPECT_NE(outcome.status, 0);
  EXPECT_THAT(outcome.text, HasSubstr("--show: DISPLAY is not set"));
}

/// The number after the last "cost".
double lastCost(const std::string &text)
{
  const std::regex number("cost +([-0-9.e+]+)");
  double value = -1;
  for (std::sregex_iterator at(text.begin(), text.end(), number), end; at != end; ++at)
    value = std::stod((*at)[1]);
  return value;
}

TEST(Graph, OfARunIsExportedAndSolvesToTheCostOfTheRun)
{
  const std::string folder = freshFolder("graph"), exported = folder + "/exported.g2o", solved = folder + "/solved.g2o";
  ASSERT_EQ(run("track " + kFlight + " -o " + folder + " --no-video --frames 40").status, 0);
  EXPECT_EQ(run("export " + folder + " g2o -o " + exported).status, 0);
  const std::string told = run("graph " + folder).text;
  EXPECT_THAT(told, HasSubstr("poses      40"));
  const Outcome outcome = run("solve " + exported + " -o " + solved);
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_GT(lastCost(told), 0);
  EXPECT_NEAR(lastCost(outcome.text), lastCost(told), 1e-4 * lastCost(told)); // the run ends at its optimum
  EXPECT_EQ(linesIn(solved), linesIn(exported));
}

TEST(Graph, OfAFileThatIsNoneTheLineIsNamedAndNothingIsWritten)
{
  const std::string broken = freshFolder("broken.g2o"), none = freshFolder("none.g2o");
  std::ofstream(broken) << "VERTEX_SE3:QUAT 0 nan 0 0 0 0 0 1\n";
  const Outcome outcome = run("solve " + broken + " -o " + none);
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.text, HasSubstr(broken + ":1: VERTEX_SE3:QUAT: 2 = nan, must be a finite number"));
  EXPECT_FALSE(std::filesystem::exists(none));
}
} // namespace
