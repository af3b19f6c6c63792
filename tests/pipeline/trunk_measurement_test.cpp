// SPDX-License-Identifier: GPL-2.0-or-later
// The gate between a prediction and what was found, and what a view counts for.
#include "pipeline/trunk_measurement.h"

#include <gtest/gtest.h>

#include <cmath>

namespace bole
{
namespace
{
constexpr double kFocal = 200;

struct Case
{
  TrackingPrediction prediction;
  TrackingResult result;
  FlowOptions options;
};

/// A trunk found \p bearing [rad] and \p log_ratio off its prediction.
Case found(double bearing, double log_ratio = 0)
{
  Case c;
  c.prediction.relative.log_ratio = std::log(0.05);
  c.prediction.covariance = Vector4d(1e-4, 1e-4, std::pow(0.01, 2), std::pow(0.1, 2)).asDiagonal();
  c.result.status = TrackingStatus::tracked;
  c.result.optimum = c.prediction.relative.plus({0, 0, bearing, log_ratio});
  c.result.left_used = c.result.right_used = true;
  c.result.left_contrast = -0.1;
  c.result.right_contrast = 0.1;
  return c;
}

bool isInside(const Case &c) { return isInsideGate(c.prediction, c.result, kFocal, c.options); }

TEST(Gate, IsAsWideAsPredictionAndBordersTogether)
{
  const double sigma = std::hypot(0.01, 1.0 / kFocal); // of the bearing
  const double edge = std::sqrt(FlowOptions().gate) * sigma;
  EXPECT_TRUE(isInside(found(0.99 * edge)));
  EXPECT_TRUE(isInside(found(-0.99 * edge)));
  EXPECT_FALSE(isInside(found(1.01 * edge)));
}

TEST(Gate, AsksTheWidthOnlyWhereBothBordersWereSeen)
{
  Case c = found(0, 2);
  EXPECT_FALSE(isInside(c));
  c.result.right_used = false;
  EXPECT_TRUE(isInside(c));
}

TEST(Gate, IsWiderWhereThePredictionKnowsLess)
{
  Case c = found(0.1);
  EXPECT_FALSE(isInside(c));
  c.prediction.covariance(2, 2) = 0.01;
  EXPECT_TRUE(isInside(c));
}

TEST(Misfit, GrowsWithTheSquareOfTheOffsetInPixelsAndEndsSomewhere)
{
  const auto misfitOf = [](double pixels) {
    const Case c = found(pixels / kFocal);
    return meanSquaredInnovation(c.result, c.prediction.relative, kFocal, c.options);
  };
  EXPECT_NEAR(misfitOf(2) / misfitOf(1), 4, 1e-6);
  EXPECT_EQ(misfitOf(4), misfitOf(40));
}

TEST(Misfit, AllowsMoreToFaintBorders)
{
  Case c = found(1 / kFocal);
  const double strong = meanSquaredInnovation(c.result, c.prediction.relative, kFocal, c.options);
  c.result.left_contrast = -0.01;
  EXPECT_LT(meanSquaredInnovation(c.result, c.prediction.relative, kFocal, c.options), 0.5 * strong);
}

TEST(WeightOfView, IsTheShareOfTheWayThatMakesViewsIndependent)
{
  FlowOptions options;
  const Eigen::Vector3d here(1, 2, 3), near(1, 2.02, 3), far(1, 3, 3);
  EXPECT_EQ(weightOfView(here, near, options), 1); // every view counts
  options.view_correlation = 0.1;
  EXPECT_EQ(weightOfView(std::nullopt, near, options), 1);
  EXPECT_NEAR(weightOfView(here, near, options), 0.2, 1e-9);
  EXPECT_EQ(weightOfView(here, far, options), 1);
  EXPECT_GT(weightOfView(here, here, options), 0); // holds the pose of a drone at rest
}
} // namespace
} // namespace bole
