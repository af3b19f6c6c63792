// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/trials/failure_sheet.h"

#include <gtest/gtest.h>

namespace bole
{
namespace
{
SimulatedTrunk standing(double x, double y)
{
  SimulatedTrunk trunk;
  trunk.foot = {x, y, 0};
  trunk.taper = trunk.flare = 0;
  return trunk;
}

KnownTrunk believed(double x, double y)
{
  KnownTrunk trunk;
  trunk.status = TrunkStatus::confirmed;
  trunk.trunk.xy = {x, y};
  return trunk;
}

/// A drone that rests at the origin before one trunk and knows it.
struct Resting
{
  std::vector<SimulatedTrunk> trunks;
  LoopRecord record;
  explicit Resting(int frames = 40)
  {
    trunks = {standing(3, 0)};
    for (int k = 0; k < frames; ++k) {
      LoopSample sample;
      sample.time_s = 0.1 * k;
      sample.phase = TaskPhase::servoing;
      sample.truth.t = sample.estimate.t = {0, 0, 1.2};
      sample.map = {believed(3, 0)};
      sample.believed = sample.real = {{"bearing [deg]", 0.1}};
      record.samples.push_back(sample);
    }
  }
  std::string sheet() { return failureSheet(record, trunks, "hold, seed 1: <lost>", findParting(record, trunks), ""); }
};

TEST(FailureSheet, BeliefAndTruthThatAgreeDoNotPart)
{
  Resting flight;
  EXPECT_FALSE(findParting(flight.record, flight.trunks));
  EXPECT_NE(flight.sheet().find("did not part"), std::string::npos);
}

TEST(FailureSheet, NamesTheFirstFrameOfAnErrorThatIsBelievedOtherwise)
{
  Resting flight;
  flight.record.samples[5].real = {{"bearing [deg]", 3}}; // one frame is none
  for (std::size_t k = 12; k < 40; ++k)
    flight.record.samples[k].real = {{"bearing [deg]", 1}};
  const auto parting = findParting(flight.record, flight.trunks);
  ASSERT_TRUE(parting);
  EXPECT_EQ(parting->sample, 12u);
  EXPECT_EQ(parting->what, "bearing [deg]: believed 0.10, is 1.00");
  EXPECT_NE(flight.sheet().find("parted at 1.2 s"), std::string::npos);
}

TEST(FailureSheet, NamesATrunkThatIsNone)
{
  Resting flight;
  for (std::size_t k = 20; k < 40; ++k)
    flight.record.samples[k].map.push_back(believed(2, 1.5));
  const auto parting = findParting(flight.record, flight.trunks);
  ASSERT_TRUE(parting);
  EXPECT_EQ(parting->sample, 20u);
  EXPECT_NE(parting->what.find("stands where none"), std::string::npos);
}

TEST(FailureSheet, ADriftOfDroneAndMapTogetherIsNoParting)
{
  Resting flight;
  for (LoopSample &sample : flight.record.samples) {
    sample.estimate.t.x() = 10;
    sample.map = {believed(13, 0)};
  }
  EXPECT_FALSE(findParting(flight.record, flight.trunks));
}

TEST(FailureSheet, NamesATrunkNearAheadThatTheMapDoesNotHold)
{
  Resting flight;
  flight.trunks.push_back(standing(1.5, 0.4));
  const auto parting = findParting(flight.record, flight.trunks);
  ASSERT_TRUE(parting);
  EXPECT_NE(parting->what.find("does not hold"), std::string::npos);
  flight.trunks.back() = standing(-1.5, 0.4); // behind it, it cannot have seen one
  EXPECT_FALSE(findParting(flight.record, flight.trunks));
}

TEST(FailureSheet, TellsWhichSensorsContradictedTheOthers)
{
  Resting flight;
  flight.record.verdicts.push_back({"gyro", "rotation", 1.5, "gyro: contradicts the points since 1.5 s"});
  EXPECT_NE(flight.sheet().find("<p>gyro: contradicts the points since 1.5 s.</p>"), std::string::npos);
}

TEST(FailureSheet, IsAPageWithMapsAndCurvesAndNoMarkupOfItsTitle)
{
  Resting flight;
  const std::string page = flight.sheet();
  EXPECT_EQ(page.find("<lost>"), std::string::npos);
  EXPECT_NE(page.find("&lt;lost&gt;"), std::string::npos);
  EXPECT_NE(page.find("<svg"), page.rfind("<svg"));
  EXPECT_EQ(page.find("nan"), std::string::npos);
  EXPECT_NE(page.find("</html>"), std::string::npos);
}
} // namespace
} // namespace bole
