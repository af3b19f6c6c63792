// SPDX-License-Identifier: GPL-2.0-or-later
// `bole follow` as its users run it: the demonstration flight in a model of its wood.
#include "run_bole.h"
#include "support/test.h"

#include "input/recorded_source.h"
#include "mbt/model_files.h"
#include <bole/open_source.h>

namespace
{
namespace fs = std::filesystem;
using namespace bole;
using namespace bole::test;
using testing::HasSubstr;

const std::string kFirstPose = " --init 0,1.19,1.12,-6.4"; ///< of the demonstration's pose filter

/// The wood as it is, or with \p side = -1 mirrored: another wood of the same density.
std::string modelOfTheWood(const std::string &folder, double side = 1)
{
  std::vector<Cylinder> trunks;
  for (const TruthTrunk &tree : readTruthTrunks(kFlight))
    if (const double x = tree.xy.x(), y = side * tree.xy.y(); tree.radius > 0)
      trunks.push_back({{x, y, 0.1}, {x, y, 4}, tree.radius, ""});
  fs::create_directories(folder);
  writeCao(folder + "/wood.cao", trunks);
  return folder + "/wood.cao";
}

constexpr std::size_t kHead = 2; ///< lines of a table: names and units

/// Farthest that the trajectory in \p folder is from the truth [m].
double worstError(const std::string &folder)
{
  const Trajectory truth = AslSource(kFlight).truth();
  double worst = 0;
  for (const StampedPose &pose : readTrajectory(folder + "/trajectory.tum"))
    if (const auto there = interpolate(truth, pose.stamp_ns))
      worst = std::max(worst, (pose.wMb.t - there->t).norm());
  return worst;
}

TEST(Follow, KeepsTheDemonstrationFlightInItsWood)
{
  const std::string folder = freshFolder("follow");
  const Outcome outcome =
      run("follow " + kFlight + " --model " + modelOfTheWood(folder) + kFirstPose + " -o " + folder);
  ASSERT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("first pose after 0.0 s"));
  const auto summary = jsonOf(folder + "/follow.json");
  EXPECT_EQ(summary.at("frames"), 120);
  EXPECT_GT(summary.at("followed"), 100);
  EXPECT_EQ(linesIn(folder + "/status.csv"), kHead + 120);
  EXPECT_LT(worstError(folder), 0.3);
  EXPECT_GT(fs::file_size(folder + "/overlay.mp4"), 50'000u);
}

TEST(Follow, APlainVideoIsCarriedByItsOwnPointFeatures)
{
  const std::string folder = freshFolder("follow_plain"), bare = folder + "/bare";
  const std::string model = modelOfTheWood(folder);
  fs::copy(kFlight, bare, fs::copy_options::recursive);
  fs::remove_all(bare + "/mav0/odom0");
  fs::remove_all(bare + "/mav0/imu0");
  const Outcome outcome =
      run("follow " + bare + " --model " + model + kFirstPose + " --camera-height 1.12 --no-video -o " + folder);
  ASSERT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_LT(worstError(folder), 0.5);
}

TEST(Follow, IsNotPlacedInAnotherWoodByItself)
{
  const std::string folder = freshFolder("follow_wrong");
  const Outcome outcome =
      run("follow " + kFlight + " --model " + modelOfTheWood(folder, -1) + " --frames 60 --no-video -o " + folder);
  EXPECT_EQ(outcome.status, 3) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("not placed on the map"));
  EXPECT_EQ(jsonOf(folder + "/follow.json").at("trusted"), false);
  EXPECT_EQ(jsonOf(folder + "/follow.json").at("followed"), 0);
  EXPECT_EQ(linesIn(folder + "/status.csv"), kHead + 60);
}

TEST(Follow, SaysWhatIsWrongWithAFirstPose)
{
  const std::string folder = freshFolder("follow_errors"), model = modelOfTheWood(folder);
  const std::string begin = "follow " + kFlight + " --model " + model + " -o " + folder;
  const Outcome pose = run(begin + " --init 1,2,3");
  EXPECT_EQ(pose.status, 1);
  EXPECT_THAT(pose.text, HasSubstr("--init = 1,2,3, must be X,Y,Z,YAW, click or map"));
  const Outcome click = run(begin + " --init click", "env -u DISPLAY ");
  EXPECT_EQ(click.status, 1);
  EXPECT_THAT(click.text, HasSubstr("DISPLAY"));
}
} // namespace
