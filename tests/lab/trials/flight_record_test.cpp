// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "simulation/vpSimulatorArDrone.h"
#include "tasks/trunk_task.h"
#include "trials/closed_loop.h"
#include "trials/servo_trial.h"
#include <complex>
#include <nlohmann/json.hpp>

using namespace bole;

namespace
{
using Complex = std::complex<double>;
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

TEST(FlightRecord, HoldsTheMapAtThePartingAndAtTheEndAndTheSensorsThatContradictedOthers)
{
  Resting flight;
  flight.record.verdicts.push_back({"gyro", "rotation", 1.5, "gyro: contradicts the points since 1.5 s"});
  EXPECT_EQ(flight.failure()["sensors"], nlohmann::json({"gyro: contradicts the points since 1.5 s"}));
  EXPECT_EQ(flight.failure()["maps"].size(), 1u);
  flight.trunks.push_back(standing(1.5, 0.4));
  const nlohmann::json maps = flight.failure()["maps"];
  ASSERT_EQ(maps.size(), 2u);
  EXPECT_DOUBLE_EQ(maps[0]["time_s"], 0);
  EXPECT_EQ(maps[0]["trunks"].size(), 2u);
  EXPECT_EQ(maps[0]["believed"].size(), 1u);
  EXPECT_EQ(maps[0]["drone"], nlohmann::json({0.0, 0.0, 0.0}));
}

// The margins of the loop that `hold` and `circle` close: the law itself on the simulated drone, with exact features.

Forest oneTrunk()
{
  ForestOptions options;
  options.density = options.undergrowth = options.saplings = options.crown_leaves = options.ground_amplitude = 0;
  return Forest::plant(options, {{0, 0, 1}}, {standing(3, 0)});
}

/// Open loop at \p hertz, broken where the velocity of \p axis (0 ahead, 3 turn) enters the drone: a sine is added
/// there, and what comes back tells the sensitivity S, so L = 1/S - 1. In this way the loop stays closed while it is
/// measured.
Complex openLoop(double hertz, unsigned axis, const TrunkTaskOptions &options)
{
  const double amplitude = axis == 0 ? 0.05 : 0.03; // within what is linear
  const Forest forest = oneTrunk();
  vpSimulatorArDrone::Options settings = ServoTrialOptions::defaultRobot();
  settings.has_images = false;
  settings.body.gust = settings.body.velocity_noise = 0;
  vpSimulatorArDrone robot(forest, settings);
  robot.setMaxTranslationVelocity(2);
  robot.setMaxRotationVelocity(2);
  robot.open(vpSimulatorArDrone::Permission::fly);
  robot.takeOff();
  for (int k = 0; k < 40; ++k) {
    robot.hover();
    robot.advance(0.1);
  }
  TrunkTask task(robot.bMc(), options);
  const Trunk cylinder = forest.trunks[0].cylinder();
  const double settle_s = 20, measured_s = std::ceil(20 * hertz) / hertz;
  Complex back(0, 0), in(0, 0);
  const double begin = robot.time();
  for (Frame frame; robot.time() - begin < settle_s + measured_s;) {
    robot.next(frame);
    const double t = 1e-9 * static_cast<double>(frame.stamp_ns);
    vpFeatureTrunk feature;
    feature.buildFrom(cylinder, *frame.wMb_truth * robot.bMc());
    const Eigen::Vector4d ordered = task.velocityFor(feature, cylinder.radius(), t, 0);
    const double disturbance = amplitude * std::sin(2 * M_PI * hertz * t);
    vpColVector v(6, 0.0);
    v[0] = ordered(0), v[1] = ordered(1), v[5] = ordered(3);
    v[axis == 0 ? 0 : 5] += disturbance;
    robot.setVelocity(vpRobot::REFERENCE_FRAME, v);
    if (t - begin < settle_s)
      continue;
    const Complex wave = std::polar(1.0, -2 * M_PI * hertz * t);
    back += (ordered(axis) + disturbance) * wave;
    in += disturbance * wave;
  }
  return in / back - 1.0;
}

struct Margins
{
  double modulus = 1e9;   ///< least distance of the open loop to -1: 1 over the largest sensitivity
  double gain = 1e9;      ///< least factor that makes it unstable
  double phase_deg = 180; ///< least lag that does, where the gain is 1
};

Margins marginsOf(unsigned axis, const TrunkTaskOptions &options)
{
  Margins margins;
  Complex last(0, 0);
  for (double hertz = 0.04; hertz < 4.6; hertz *= 1.12) {
    const Complex L = openLoop(hertz, axis, options);
    margins.modulus = std::min(margins.modulus, std::abs(1.0 + L));
    if (hertz > 0.05 && last.imag() * L.imag() < 0 && L.real() < 0)
      margins.gain = std::min(margins.gain, 1 / std::abs(L));
    if (std::abs(last) > 1 && std::abs(L) <= 1)
      margins.phase_deg = std::min(margins.phase_deg, 180 - std::abs(std::arg(L)) * 180 / M_PI);
    last = L;
  }
  return margins;
}

TEST(LoopMargins, TurnAndApproachKeepAMarginOfAHalf)
{
  for (const unsigned axis : {0u, 3u}) {
    TrunkTaskOptions options;
    options.ratio = 0.05; // of the image alone
    const Margins margins = marginsOf(axis, options);
    const std::string text =
        fmt::format("{}: modulus {:.2f}, gain {:.2f}, phase {:.0f} degrees", axis == 0 ? "approach" : "turn",
                    margins.modulus, margins.gain, margins.phase_deg);
    std::printf("%s\n", text.c_str());
    EXPECT_GT(margins.modulus, 0.5) << text; // and so a gain margin of 2 and a phase margin of 29 degrees at the least
    EXPECT_GT(margins.gain, 2) << text;
    EXPECT_GT(margins.phase_deg, 35) << text;
  }
}

TEST(LoopMargins, APredictorThatKnowsNoDelayLeavesLess)
{
  TrunkTaskOptions options;
  options.ratio = 0.05;
  options.response.delay = 0;
  for (const unsigned axis : {0u, 3u})
    EXPECT_LT(marginsOf(axis, options).modulus, 0.45);
}
} // namespace
