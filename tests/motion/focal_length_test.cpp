// SPDX-License-Identifier: GPL-2.0-or-later
#include "rendered_walls.h"

#include "geometry/so3.h"
#include "motion/focal_length.h"

#include <gtest/gtest.h>
#include <visp3/core/vpException.h>

namespace
{
using namespace bole;
using namespace bole::test;

PinholeCamera guessOf(const PinholeCamera &camera, double factor)
{
  PinholeCamera guess = camera;
  guess.fx *= factor;
  guess.fy *= factor;
  return guess;
}

TEST(FocalLength, ATurningCameraTellsItFromAGuessThatIsOffByTwo)
{
  const PinholeCamera camera;
  for (const double off : {0.5, 2.0}) {
    const PinholeCamera guess = guessOf(camera, off);
    PointTracker tracker(guess);
    FocalFromTurning focal(guess);
    for (int k = 0; k < 30; ++k) {
      tracker.track(drawWalls(camera, {expSo3({0.002 * k, 0.02 * k - 0.3, 0}), {0, 0, 0}}));
      focal.add(tracker);
    }
    const FocalEstimate estimate = focal.estimate();
    ASSERT_TRUE(estimate.known) << off;
    EXPECT_NEAR(estimate.factor * off, 1, 0.05) << off;
    EXPECT_LT(estimate.sigma, 0.1);
  }
}

TEST(FocalLength, AFlightDoesNotTellIt)
{
  const PinholeCamera camera;
  PointTracker tracker(camera);
  FocalFromTurning focal(camera);
  for (int k = 0; k < 30; ++k) {
    tracker.track(drawWalls(camera, {Eigen::Matrix3d::Identity(), {0.12 * k, 0, 0.1 * k}}));
    focal.add(tracker);
  }
  EXPECT_FALSE(focal.estimate().known);
}

TEST(FocalLength, OptionsNameTheFault)
{
  FocalOptions options;
  options.min_pairs = 0;
  EXPECT_THROW(FocalFromTurning(PinholeCamera(), options), vpException);
}
} // namespace
