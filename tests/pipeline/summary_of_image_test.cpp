// SPDX-License-Identifier: GPL-2.0-or-later
// What the summary factor stands for: the image energy round its optimum, looked up on a grid.
#include "summary/square_root.h"
#include "tracking/trunk_tracker.h"

#include <gtest/gtest.h>

#include <cmath>

namespace
{
using namespace bole;

const PinholeCamera kCamera;

RelativeTrunk seenTrunk()
{
  Trunk trunk;
  trunk.xy = {4, 0.4};
  trunk.log_radius = std::log(0.2);
  return relativeTrunk(Pose((Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished(), {0, 0, 1.2}), Pose(), trunk);
}

/// The trunk as a flat area of grey, dark on the left background, bright against the right one.
vpImage<unsigned char> drawn(const RelativeTrunk &trunk)
{
  vpImage<unsigned char> image(240, 320);
  const Eigen::Vector3d left = trunk.borderNormal(Border::left), right = trunk.borderNormal(Border::right);
  for (int v = 0; v < 240; ++v)
    for (int u = 0; u < 320; ++u) {
      const Eigen::Vector3d ray = kCamera.ray(Eigen::Vector2d(u, v));
      const double in_left = std::clamp(0.5 - left.dot(ray) * kCamera.fx, 0.0, 1.0);
      const double in_right = std::clamp(0.5 - right.dot(ray) * kCamera.fx, 0.0, 1.0);
      image[v][u] = static_cast<unsigned char>(std::lround(210 - 110 * in_left - 60 * (1 - in_right)));
    }
  return image;
}

TEST(SummaryOfAnImage, FollowsTheImageEnergyOnAGridRoundItsOptimum)
{
  const RelativeTrunk truth = seenTrunk();
  const Gradient gradient = computeGradient(drawn(truth));
  TrackingPrediction prediction;
  prediction.relative = truth.plus({0.004, 0, 0.008, 0.03});
  const TrackingOptions options;
  const TrackingResult tracked = trackTrunk(gradient, kCamera, prediction, options);
  ASSERT_EQ(tracked.status, TrackingStatus::tracked) << toString(tracked.status);
  const SummaryFactor summary{tracked.optimum, tracked.energy, tracked.f, tracked.F};
  SquareRootSummary root;
  ASSERT_EQ(squareRoot(summary, root), SummaryStatus::ok);
  const TrunkEnergy image(gradient, kCamera, prediction.range, {true, std::abs(tracked.left_contrast)},
                          {true, std::abs(tracked.right_contrast)}, options.energy);
  const double here = image.evaluate(tracked.optimum);

  // steps that move a border, or one of its ends, by about 0.4 px
  const double turn = 0.4 / 50, bearing = 0.4 / kCamera.fx, widen = 0.4 / (kCamera.fx * truth.ratio());
  int looked = 0;
  for (int i = -2; i <= 2; ++i)
    for (int j = -2; j <= 2; ++j)
      for (int k = -2; k <= 2; ++k) {
        if (std::abs(i) + std::abs(j) + std::abs(k) == 0 || std::abs(i) + std::abs(j) + std::abs(k) > 3)
          continue;
        const RelativeTrunk at = tracked.optimum.plus({i * turn, 0, j * bearing, k * widen});
        const double rise = image.evaluate(at) - here;
        EXPECT_GT(rise, 0) << i << j << k; // the optimum is one
        EXPECT_NEAR((summary.energyAt(at) - summary.energy) / rise, 1, 0.35) << i << " " << j << " " << k;
        EXPECT_NEAR(0.5 * root.residual(at).squaredNorm() + root.constant, summary.energyAt(at), 1e-9);
        ++looked;
      }
  EXPECT_GT(looked, 50);
}

TEST(SummaryOfAnImage, KnowsThePlaceOfABorderToWhatAlphaSays)
{
  const RelativeTrunk truth = seenTrunk();
  const Gradient gradient = computeGradient(drawn(truth));
  TrackingPrediction prediction;
  prediction.relative = truth;
  TrackingOptions options;
  const auto sigmaOfBearing = [&](double alpha) {
    options.energy.alpha = alpha;
    const TrackingResult tracked = trackTrunk(gradient, kCamera, prediction, options);
    return kCamera.fx / std::sqrt(tracked.F(2, 2)); // with r/d known [px]
  };
  // two borders of 1/alpha px^2 each
  EXPECT_NEAR(sigmaOfBearing(0.5), 1, 0.35);
  EXPECT_NEAR(sigmaOfBearing(0.5) / sigmaOfBearing(2), 2, 0.01);
}
} // namespace
