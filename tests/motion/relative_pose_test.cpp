// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"
#include "synthetic.h"

#include "motion/epipolar.h"
#include "motion/row_shear.h"

namespace
{
using namespace bole;
using namespace bole::test;

const PinholeCamera kCamera;

TEST(SampsonResidual, IsTheNoiseOfOneImageCoordinate)
{
  CloudOptions options;
  options.points = 4000;
  options.noise_px = 0.2;
  const Pose aMb = typicalMotion();
  const auto matches = cloudMatches(kCamera, aMb, options);
  std::vector<double> residuals(matches.size());
  const motion::Rays rays(matches, kCamera);
  residualsOfMatches(rays, motion::termsOf({aMb.R, aMb.t.normalized()}, 1), residuals.data());
  double sum = 0;
  for (const double r : residuals)
    sum += r * r;
  EXPECT_NEAR(std::sqrt(sum / double(matches.size())) * kCamera.fx, 0.2, 0.01);
}

TEST(RelativePose, ExactMatchesGiveTheExactMotionWithoutAPrior)
{
  const Pose aMb = typicalMotion();
  const auto estimate = estimateRelativePose(cloudMatches(kCamera, aMb, {}), kCamera);
  EXPECT_EQ(estimate.status, RelativePoseStatus::ok);
  EXPECT_LT(rotationErrorDeg(estimate.aRb, aMb.R), 1e-4);
  EXPECT_LT(directionErrorDeg(estimate.direction, aMb.t), 1e-3);
}

TEST(RelativePose, SwappingTheFramesInvertsTheMotion)
{
  const Pose aMb = typicalMotion(), bMa = aMb.inverse();
  auto matches = cloudMatches(kCamera, aMb, {});
  for (auto &match : matches)
    std::swap(match.a_px, match.b_px);
  const auto estimate = estimateRelativePose(matches, kCamera);
  EXPECT_EQ(estimate.status, RelativePoseStatus::ok);
  EXPECT_LT(rotationErrorDeg(estimate.aRb, bMa.R), 1e-4);
  EXPECT_LT(directionErrorDeg(estimate.direction, bMa.t), 1e-3);
}

TEST(RelativePose, KeepsOffFortyPercentOfOutliers)
{
  const Pose aMb = typicalMotion();
  for (unsigned seed = 1; seed <= 10; ++seed) {
    CloudOptions options;
    options.noise_px = 0.15;
    options.outliers = 0.4;
    options.seed = seed;
    const auto estimate = estimateRelativePose(cloudMatches(kCamera, aMb, options), kCamera);
    EXPECT_EQ(estimate.status, RelativePoseStatus::ok) << seed;
    EXPECT_LT(rotationErrorDeg(estimate.aRb, aMb.R), 0.2) << seed;
    EXPECT_LT(directionErrorDeg(estimate.direction, aMb.t), 2) << seed;
    EXPECT_LT(estimate.sigma_px, 0.4) << seed;
  }
}

TEST(RelativePose, FindsTheSignOfTheDirectionFromTheDepths)
{
  for (const Eigen::Vector3d &t : {Eigen::Vector3d(0, 0, 0.4), Eigen::Vector3d(0, 0, -0.4), Eigen::Vector3d(0.3, 0, 0),
                                   Eigen::Vector3d(-0.3, 0, 0), Eigen::Vector3d(0, 0.3, 0.05)}) {
    CloudOptions options;
    options.noise_px = 0.1;
    const auto estimate = estimateRelativePose(cloudMatches(kCamera, {expSo3({0, 0.02, 0}), t}, options), kCamera);
    EXPECT_LT(directionErrorDeg(estimate.direction, t), 5) << t.transpose();
  }
}

TEST(RelativePose, CovarianceIsHonestForIndependentNoise)
{
  double sum = 0;
  int n = 0;
  for (unsigned seed = 1; seed <= 60; ++seed) {
    CloudOptions options;
    options.noise_px = 0.15;
    options.seed = seed;
    const Pose aMb = typicalMotion();
    const auto estimate = estimateRelativePose(cloudMatches(kCamera, aMb, options), kCamera);
    ASSERT_TRUE(estimate.hasDirection());
    Vector5d error;
    error << logSo3(estimate.aRb.transpose() * aMb.R), directionMinus(aMb.t.normalized(), estimate.direction);
    sum += motion::kInflation * error.dot(estimate.covariance.ldlt().solve(error));
    ++n;
  }
  EXPECT_GT(sum / (5 * n), 0.6);
  EXPECT_LT(sum / (5 * n), 1.6);
}

TEST(RelativePose, ACameraThatOnlyTurnsGetsItsRotationAndNoDirection)
{
  const Pose aMb{expSo3({0.02, 0.08, -0.01}), Eigen::Vector3d::Zero()};
  for (unsigned seed = 1; seed <= 10; ++seed) {
    CloudOptions options;
    options.noise_px = 0.15;
    options.seed = seed;
    const auto estimate = estimateRelativePose(cloudMatches(kCamera, aMb, options), kCamera);
    EXPECT_EQ(estimate.status, RelativePoseStatus::no_parallax) << seed;
    EXPECT_LT(rotationErrorDeg(estimate.aRb, aMb.R), 0.05) << seed;
    EXPECT_GT(estimate.covariance(3, 3), 1);
  }
}

TEST(RelativePose, FrozenFramesAreARestingCamera)
{
  CloudOptions options;
  auto matches = cloudMatches(kCamera, typicalMotion(), options);
  for (auto &match : matches)
    match.b_px = match.a_px;
  const auto estimate = estimateRelativePose(matches, kCamera);
  EXPECT_EQ(estimate.status, RelativePoseStatus::no_parallax);
  EXPECT_LT(rotationErrorDeg(estimate.aRb, Eigen::Matrix3d::Identity()), 1e-3);
}

TEST(RelativePose, WithoutPointsReturnsThePrior)
{
  RelativePosePrior prior;
  prior.aRb = expSo3({0, 0.1, 0});
  prior.rotation_covariance = 1e-6 * Eigen::Matrix3d::Identity();
  prior.translation = Eigen::Vector3d(0, 0, 2);
  prior.translation_covariance = 0.04 * Eigen::Matrix3d::Identity();
  const auto estimate = estimateRelativePose({}, kCamera, prior);
  EXPECT_EQ(estimate.status, RelativePoseStatus::too_few_points);
  EXPECT_LT(rotationErrorDeg(estimate.aRb, *prior.aRb), 1e-9);
  EXPECT_LT(directionErrorDeg(estimate.direction, *prior.translation), 1e-9);
  EXPECT_NEAR(estimate.covariance(0, 0), 1e-6, 1e-12);
  EXPECT_NEAR(estimate.covariance(3, 3), 0.01, 1e-6);
}

TEST(RelativePose, MatchesWithoutACommonMotionAreSaidToBeInconsistent)
{
  CloudOptions options;
  options.outliers = 1;
  const auto estimate = estimateRelativePose(cloudMatches(kCamera, typicalMotion(), options), kCamera);
  EXPECT_EQ(estimate.status, RelativePoseStatus::inconsistent);
}

TEST(RelativePose, APlaneInViewNeedsTheGyro)
{
  CloudOptions options;
  options.planar = true;
  options.far = 4;
  options.noise_px = 0.1;
  const Pose aMb = typicalMotion();
  RelativePosePrior prior;
  prior.aRb = aMb.R * expSo3({3e-4, -2e-4, 3e-4});
  prior.rotation_covariance = 1e-7 * Eigen::Matrix3d::Identity();
  const auto matches = cloudMatches(kCamera, aMb, options);
  const auto with = estimateRelativePose(matches, kCamera, prior);
  EXPECT_EQ(with.status, RelativePoseStatus::ok);
  EXPECT_LT(directionErrorDeg(with.direction, aMb.t), 3);
  // Without it one of the plane's two motions, and if both fit, the status says so.
  const auto without = estimateRelativePose(matches, kCamera);
  EXPECT_TRUE(without.status == RelativePoseStatus::ambiguous || directionErrorDeg(without.direction, aMb.t) < 8)
      << without.direction.transpose();
}

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
