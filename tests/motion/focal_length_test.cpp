// SPDX-License-Identifier: GPL-2.0-or-later
#include "rendered_walls.h"
#include "support/differences.h"

#include "geometry/so3.h"
#include "motion/bundle.h"
#include "motion/epipolar.h"
#include "motion/focal_length.h"
#include <bole/open_source.h>
#include <bole/trunk.h>

namespace
{
using namespace bole;
using namespace bole::test;
using motion::reprojection;

/// Of a camera that sees drawn walls from each pose.
template <typename PoseOf> FocalEstimate estimateOf(double off, PoseOf poseOf)
{
  const PinholeCamera camera, guess = motion::withFocal(camera, off);
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
    const PinholeCamera guess = motion::withFocal(source->camera(), off);
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

const Pose kA(expSo3({0.1, -0.2, 0.05}), {0.3, -0.1, 0.2});
const Pose kB(expSo3({0.12, -0.1, 0.02}), {0.6, -0.15, 0.5});
const Eigen::Vector2d kXy(0.2, -0.1), kSeen(0.15, -0.12);
constexpr double kInverseDepth = 0.2, kFocal = 1.2;

TEST(Reprojection, JacobiansAgreeWithCentralDifferencesAtTwoSteps)
{
  Eigen::Matrix<double, 2, 6> J_a, J_b;
  Eigen::Vector2d J_q, J_f;
  reprojection(kA, kB, kXy, kInverseDepth, kSeen, &J_a, &J_b, &J_q, kFocal, &J_f);
  Eigen::Matrix<double, 2, 14> J; // by both poses, the inverse depth and the log of the focal length
  J << J_a, J_b, J_q, J_f;
  const auto residual = [](const Eigen::VectorXd &xi) {
    return reprojection(kA.plus(xi.head<6>()), kB.plus(xi.segment<6>(6)), kXy, kInverseDepth + xi[12], kSeen, nullptr,
                        nullptr, nullptr, kFocal * std::exp(xi[13]));
  };
  expectDerivative(residual, J, 1e-3, 1e-5);
}

/// A camera that flies a curve among points, seen with a focal length that is off.
TEST(SolveBundle, FindsTheFocalLengthByWhichAllWasNormalised)
{
  constexpr double kOff = 1.1; // of the true one: what is seen looks smaller
  constexpr int kFrames = 10, kPoints = 60;
  std::vector<motion::BundleFrame> frames(kFrames);
  std::vector<motion::BundlePoint> points;
  for (int k = 0; k < kFrames; ++k)
    frames[k].wMc = Pose(expSo3({0.005 * k, 0.04 * k, 0}), {0.3 * k, 0.02 * k * k, 0.15 * k});
  for (int i = 0; i < kPoints; ++i) {
    const Eigen::Vector3d p(4 * std::sin(1.7 * i), 2 * std::cos(2.3 * i), 7 + 3 * std::sin(0.9 * i));
    motion::BundlePoint point;
    for (int k = 0; k < kFrames; ++k) {
      const Eigen::Vector3d c = frames[k].wMc.inverse() * p;
      if (k == 0) {
        point.xy = c.head<2>() / c.z() / kOff;
        point.inverse_depth = 1 / c.z();
      }
      else
        point.seen.push_back({std::size_t(k), c.head<2>() / c.z() / kOff, 1});
    }
    points.push_back(point);
  }
  frames[0].fixed = true;
  motion::BundleOptions options;
  options.iterations = 60;
  options.settled = 1e-9;
  options.first_baseline = (frames[1].wMc.t - frames[0].wMc.t).norm();
  options.with_focal = true;
  const motion::BundleResult result = motion::solveBundle(frames, points, options);
  ASSERT_TRUE(result.solved);
  EXPECT_NEAR(result.log_focal, -std::log(kOff), 1e-3);
}
} // namespace
