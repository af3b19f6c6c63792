// SPDX-License-Identifier: GPL-2.0-or-later
// The margins of the loop that `hold` and `circle` close: the law itself on the simulated drone, with exact features.
#include "simulation/vpSimulatorArDrone.h"
#include "tasks/trunk_task.h"
#include "trials/servo_trial.h"

#include <cmath>
#include <complex>
#include <fmt/format.h>
#include <gtest/gtest.h>

namespace bole
{
namespace
{
using Complex = std::complex<double>;

Forest oneTrunk()
{
  ForestOptions options;
  options.density = options.undergrowth = options.saplings = options.crown_leaves = options.ground_amplitude = 0;
  SimulatedTrunk trunk;
  trunk.foot = {3, 0, 0};
  trunk.taper = trunk.flare = 0;
  return Forest::plant(options, {{0, 0, 1}}, {trunk});
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
} // namespace bole
