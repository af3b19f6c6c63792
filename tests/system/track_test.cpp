// SPDX-License-Identifier: GPL-2.0-or-later
// The command as its users run it: a whole flight, and their mistakes.
#include "run_bole.h"

#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>

namespace
{
namespace fs = std::filesystem;
using namespace bole::test;
using testing::HasSubstr;

void copyFlight(const std::string &to)
{
  fs::remove_all(to);
  fs::copy(kFlight, to, fs::copy_options::recursive);
}

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

void expectRefused(const std::string &arguments, const std::string &folder, const std::string &names)
{
  const Outcome outcome = run("track " + arguments + " -o " + folder + " --no-video");
  EXPECT_NE(outcome.status, 0) << arguments;
  EXPECT_THAT(outcome.text, HasSubstr(names));
  EXPECT_FALSE(fs::exists(folder + "/trunks.csv"));
}

TEST(Track, RefusesAMissingInput) { expectRefused("/nowhere/flight", freshFolder("missing"), "/nowhere/flight"); }

TEST(Track, RefusesAnEmptyFolder)
{
  const std::string empty = freshFolder("empty_input");
  fs::create_directories(empty);
  expectRefused(empty, freshFolder("empty"), empty);
}

TEST(Track, RefusesAnUnknownKey)
{
  const std::string config = testing::TempDir() + "bole_bad.yaml";
  std::ofstream(config) << "detection:\n  windwo: 3\n";
  expectRefused(kFlight + " --config " + config, freshFolder("key"), config + ":2");
}

TEST(Track, RefusesOdometryThatIsNoNumber)
{
  const std::string flight = freshFolder("nan_flight");
  copyFlight(flight);
  std::ofstream(flight + "/mav0/odom0/data.csv") << "#t,x,y,z,w,x,y,z\n0,nan,0,1,1,0,0,0\n";
  expectRefused(flight, freshFolder("nan"), "odom0/data.csv:2");
}

TEST(Track, RefusesStampsThatGoBack)
{
  const std::string flight = freshFolder("back_flight");
  copyFlight(flight);
  std::ofstream(flight + "/mav0/cam0/data.csv")
      << "#timestamp [ns],filename\n100000000,0000100000000.png\n0,0000000000000.png\n";
  expectRefused(flight, freshFolder("back"), "cam0/data.csv:3");
}

TEST(Track, PassesOverATruncatedImage)
{
  const std::string flight = freshFolder("cut_flight"), folder = freshFolder("cut");
  copyFlight(flight);
  fs::resize_file(flight + "/mav0/cam0/data/0000500000000.png", 900);
  ASSERT_EQ(run("track " + flight + " -o " + folder + " --no-video --frames 12").status, 0);
  const auto summary = jsonOf(folder + "/summary.json");
  EXPECT_THAT(summary.at("frames").dump(), HasSubstr("corrupt"));
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
} // namespace
