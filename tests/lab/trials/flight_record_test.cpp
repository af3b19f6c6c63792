// SPDX-License-Identifier: GPL-2.0-or-later
#include "trials/flight_record.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

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
  nlohmann::json failure() const
  {
    return nlohmann::json::parse(failureJson(record, trunks, "hold, seed 1", findParting(record, trunks)));
  }
};

TEST(FlightRecord, BeliefAndTruthThatAgreeDoNotPart)
{
  Resting flight;
  EXPECT_FALSE(findParting(flight.record, flight.trunks));
  EXPECT_FALSE(flight.failure().contains("parting"));
}

TEST(FlightRecord, NamesTheFirstFrameOfAnErrorThatIsBelievedOtherwise)
{
  Resting flight;
  flight.record.samples[5].real = {{"bearing [deg]", 3}}; // one frame is none
  for (std::size_t k = 12; k < 40; ++k)
    flight.record.samples[k].real = {{"bearing [deg]", 1}};
  const auto parting = findParting(flight.record, flight.trunks);
  ASSERT_TRUE(parting);
  EXPECT_EQ(parting->sample, 12u);
  EXPECT_EQ(parting->what, "bearing [deg]: believed 0.10, is 1.00");
  EXPECT_DOUBLE_EQ(flight.failure()["parting"]["time_s"], 1.2);
}

TEST(FlightRecord, NamesATrunkThatIsNone)
{
  Resting flight;
  for (std::size_t k = 20; k < 40; ++k)
    flight.record.samples[k].map.push_back(believed(2, 1.5));
  const auto parting = findParting(flight.record, flight.trunks);
  ASSERT_TRUE(parting);
  EXPECT_EQ(parting->sample, 20u);
  EXPECT_NE(parting->what.find("stands where none"), std::string::npos);
}

TEST(FlightRecord, ADriftOfDroneAndMapTogetherIsNoParting)
{
  Resting flight;
  for (LoopSample &sample : flight.record.samples) {
    sample.estimate.t.x() = 10;
    sample.map = {believed(13, 0)};
  }
  EXPECT_FALSE(findParting(flight.record, flight.trunks));
}

TEST(FlightRecord, NamesATrunkNearAheadThatTheMapDoesNotHold)
{
  Resting flight;
  flight.trunks.push_back(standing(1.5, 0.4));
  const auto parting = findParting(flight.record, flight.trunks);
  ASSERT_TRUE(parting);
  EXPECT_NE(parting->what.find("does not hold"), std::string::npos);
  flight.trunks.back() = standing(-1.5, 0.4); // behind it, it cannot have seen one
  EXPECT_FALSE(findParting(flight.record, flight.trunks));
}

TEST(FlightRecord, TellsWhichSensorsContradictedTheOthers)
{
  Resting flight;
  flight.record.verdicts.push_back({"gyro", "rotation", 1.5, "gyro: contradicts the points since 1.5 s"});
  EXPECT_EQ(flight.failure()["sensors"], nlohmann::json({"gyro: contradicts the points since 1.5 s"}));
}

TEST(FlightRecord, HoldsTheMapAtThePartingAndAtTheEnd)
{
  Resting flight;
  EXPECT_EQ(flight.failure()["maps"].size(), 1u);
  flight.trunks.push_back(standing(1.5, 0.4));
  const nlohmann::json maps = flight.failure()["maps"];
  ASSERT_EQ(maps.size(), 2u);
  EXPECT_DOUBLE_EQ(maps[0]["time_s"], 0);
  EXPECT_EQ(maps[0]["trunks"].size(), 2u);
  EXPECT_EQ(maps[0]["believed"].size(), 1u);
  EXPECT_EQ(maps[0]["drone"], nlohmann::json({0.0, 0.0, 0.0}));
}
} // namespace
} // namespace bole
