// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/row_shear.h"

#include "motion/synthetic.h"

#include <gtest/gtest.h>

namespace
{
using namespace bole;
using namespace bole::test;

const PinholeCamera kCamera;

RelativePosePrior gyroOf(const Pose &aMb)
{
  RelativePosePrior prior;
  prior.aRb = aMb.R;
  prior.rotation_covariance = 1e-7 * Eigen::Matrix3d::Identity();
  return prior;
}

/// Matches of a cloud whose image b is sheared.
std::vector<PointMatch> shearedMatches(const Pose &aMb, double shear, const CloudOptions &options)
{
  std::vector<PointMatch> matches = cloudMatches(kCamera, aMb, options);
  for (PointMatch &match : matches)
    match.b_px.x() += shear * (match.b_px.y() - kCamera.cy) * kCamera.fx / kCamera.fy;
  return matches;
}

CloudOptions noisy(unsigned seed)
{
  CloudOptions options;
  options.noise_px = 0.1;
  options.outliers = 0.15;
  options.seed = seed;
  return options;
}

TEST(RowShear, AShearComesBackWithinThreeStandardDeviations)
{
  const Pose aMb = typicalMotion();
  for (const double shear : {-0.04, -0.01, 0.0, 0.02, 0.05})
    for (unsigned seed = 1; seed <= 5; ++seed) {
      const RowShear found = estimateRowShear(shearedMatches(aMb, shear, noisy(seed)), kCamera, gyroOf(aMb), {aMb});
      EXPECT_LT(std::abs(found.shear - shear), 3 * found.sigma) << shear << " seed " << seed;
      EXPECT_LT(found.sigma, 0.005);
    }
}

TEST(RowShear, OfSeveralStartsTheOneThatExplainsMostWins)
{
  const Pose aMb = typicalMotion();
  const Pose astray(aMb.R, Eigen::Vector3d(1, 0, 0.1));
  const RowShear found = estimateRowShear(shearedMatches(aMb, 0.04, noisy(3)), kCamera, gyroOf(aMb), {astray, aMb});
  EXPECT_NEAR(found.shear, 0.04, 3 * found.sigma);
}

TEST(RowShear, ARollIsNone)
{
  const Pose aMb{expSo3({0, 0, 0.15}), {0.02, 0, 0.3}};
  const RowShear with_gyro = estimateRowShear(cloudMatches(kCamera, aMb, noisy(2)), kCamera, gyroOf(aMb), {aMb});
  const RowShear without = estimateRowShear(cloudMatches(kCamera, aMb, noisy(2)), kCamera, {}, {aMb});
  EXPECT_LT(std::abs(with_gyro.shear), 3 * with_gyro.sigma);
  EXPECT_LT(std::abs(without.shear), 3 * without.sigma);
}

TEST(RowShear, OfAFlightSidewaysItIsUnknown)
{
  const Pose aMb{expSo3({0, 0.01, 0}), {0.3, 0, 0}};
  RelativePosePrior prior = gyroOf(aMb);
  prior.translation = aMb.t;
  prior.translation_covariance = 1e-6 * Eigen::Matrix3d::Identity();
  const RowShear found = estimateRowShear(shearedMatches(aMb, 0.04, noisy(4)), kCamera, prior, {aMb});
  EXPECT_GT(found.sigma, 0.02);
}

TEST(RowShear, ItIsBelievedOnlyWhereNoMotionExplainsAsMuch)
{
  const Pose ahead = typicalMotion(), sideways{expSo3({0, 0.01, 0}), {0.03, 0, 0.001}};
  for (unsigned seed = 1; seed <= 10; ++seed) {
    for (const double shear : {-0.04, 0.02, 0.05}) {
      const auto matches = shearedMatches(ahead, shear, noisy(seed));
      const RowShear found = estimateRowShear(matches, kCamera, gyroOf(ahead), {ahead});
      EXPECT_GT(gainOfShear(found, matches, kCamera, gyroOf(ahead), {ahead}), 20) << shear << " seed " << seed;
    }
    const auto matches = shearedMatches(sideways, 0, noisy(seed));
    RowShear sure = estimateRowShear(matches, kCamera, gyroOf(sideways), {sideways});
    EXPECT_LT(gainOfShear(sure, matches, kCamera, gyroOf(sideways), {sideways}), 4) << "seed " << seed;
    sure.shear += 0.03; // as a fit that went astray says
    EXPECT_LT(gainOfShear(sure, matches, kCamera, gyroOf(sideways), {sideways}), 4) << "seed " << seed;
  }
}

TEST(RowShear, FewMatchesKnowNothing)
{
  CloudOptions few;
  few.points = 8;
  const Pose aMb = typicalMotion();
  const RowShear found = estimateRowShear(cloudMatches(kCamera, aMb, few), kCamera, gyroOf(aMb), {aMb});
  EXPECT_EQ(found.shear, 0);
  EXPECT_EQ(found.sigma, 1);
}
} // namespace
