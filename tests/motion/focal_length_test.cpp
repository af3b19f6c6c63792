// SPDX-License-Identifier: GPL-2.0-or-later
#include "rendered_walls.h"

#include "geometry/so3.h"
#include "motion/focal_length.h"
#include <bole/open_source.h>

#include <gtest/gtest.h>

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

/// Of a camera that sees drawn walls from each pose.
template <typename PoseOf> FocalEstimate estimateOf(double off, PoseOf poseOf)
{
  const PinholeCamera camera, guess = guessOf(camera, off);
  PointTracker tracker(guess);
  FocalFinder focal(guess);
  for (int k = 0; k < 40; ++k) {
    tracker.track(drawWalls(camera, poseOf(k)));
    focal.add(tracker);
  }
  return focal.estimate();
}

TEST(FocalLength, ATurningCameraTellsItFromAGuessThatIsOffByTwo)
{
  for (const double off : {0.5, 2.0}) {
    const FocalEstimate estimate = estimateOf(off, [](int k) {
      return Pose{expSo3({0.002 * k, 0.02 * k - 0.3, 0}), {0, 0, 0}};
    });
    ASSERT_TRUE(estimate.known) << off;
    EXPECT_NEAR(estimate.factor * off, 1, 0.05) << off;
  }
}

TEST(FocalLength, AFlightThroughAWoodTellsItFromAGuessThatIsOffByAThird)
{
  for (const double off : {0.75, 1.33}) {
    const auto source = openSource(BOLE_SOURCE_DIR "/data/park-forward");
    const PinholeCamera guess = guessOf(source->camera(), off);
    PointTracker tracker(guess);
    FocalFinder focal(guess);
    for (Frame frame; source->next(frame);) {
      tracker.track(frame.image);
      focal.add(tracker);
    }
    const FocalEstimate estimate = focal.estimate();
    ASSERT_TRUE(estimate.known) << off;
    EXPECT_NEAR(estimate.factor * off, 1, 2.5 * estimate.sigma) << off;
    EXPECT_NEAR(estimate.factor * off, 1, 0.02) << off;
    EXPECT_LT(estimate.sigma, 0.02) << off;
  }
}

TEST(FocalLength, AStraightFlightDoesNotTellIt)
{
  const FocalEstimate estimate = estimateOf(1, [](int k) {
    return Pose{Eigen::Matrix3d::Identity(), {0.12 * k, 0, 0.1 * k}};
  });
  EXPECT_FALSE(estimate.known);
}
} // namespace
