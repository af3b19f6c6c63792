// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/gyro.h"

#include <Eigen/Dense>

#include <gtest/gtest.h>

#include <random>

namespace
{
using namespace bole;

std::vector<GyroSample> samplesOf(const Eigen::Vector3d &rate, double noise, std::int64_t end_ns, unsigned seed = 3)
{
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, noise);
  std::vector<GyroSample> samples;
  for (std::int64_t stamp = 0; stamp <= end_ns; stamp += 5000000) {
    samples.push_back({stamp, rate + Eigen::Vector3d(normal(random), normal(random), normal(random))});
  }
  return samples;
}

TEST(Gyro, AConstantRateIntegratesToItsExponential)
{
  const Eigen::Vector3d rate(0.3, -0.5, 1.0);
  const auto turned = integrateGyro(samplesOf(rate, 0, 200000000), 12000000, 112000000);
  EXPECT_LT(logSo3(turned.R.transpose() * expSo3(0.1 * rate)).norm(), 1e-12);
  EXPECT_TRUE(turned.complete);
}

TEST(Gyro, AdjoiningIntervalsMultiply)
{
  const auto samples = samplesOf({0.3, -0.5, 1.0}, 0.1, 300000000);
  const auto first = integrateGyro(samples, 0, 105000000), second = integrateGyro(samples, 105000000, 290000000);
  const auto both = integrateGyro(samples, 0, 290000000), joined = first.then(second);
  EXPECT_LT(logSo3(joined.R.transpose() * both.R).norm(), 1e-9);
  EXPECT_NEAR(joined.duration, both.duration, 1e-12);
  EXPECT_NEAR(joined.white(0, 0), both.white(0, 0), 1e-12);
}

TEST(Gyro, AGapIsNotBridgedAsKnown)
{
  auto samples = samplesOf({0.3, -0.5, 1.0}, 0, 1000000000);
  const auto whole = integrateGyro(samples, 0, 1000000000);
  samples.erase(samples.begin() + 40, samples.begin() + 160);
  const auto torn = integrateGyro(samples, 0, 1000000000);
  EXPECT_TRUE(whole.complete);
  EXPECT_FALSE(torn.complete);
  EXPECT_GT(torn.white(0, 0), 1e3 * whole.white(0, 0));
  EXPECT_FALSE(integrateGyro({}, 0, 1000000000).complete);
}

TEST(Gyro, TheGyrosOwnRotationTeachesNothing)
{
  GyroBias bias = GyroBias::unknown({});
  bias.mean = {0.01, 0, -0.01};
  const auto turned = integrateGyro(samplesOf({0.1, 0.2, 0.3}, 0, 100000000), 0, 100000000, bias);
  const GyroBias after = refineBias(bias, turned, turned.R, turned.covariance());
  EXPECT_LT((after.mean - bias.mean).norm(), 1e-12);
  EXPECT_GE(after.covariance(0, 0), bias.covariance(0, 0));
}

TEST(Gyro, RotationsBetterThanTheGyroGiveItsBiasBack)
{
  const GyroOptions options;
  const Eigen::Vector3d rate(0.1, -0.2, 0.4), truth(0.009, -0.006, 0.003);
  const auto samples = samplesOf(rate + truth, options.noise_density / std::sqrt(0.005), 5000000000);
  GyroBias bias = GyroBias::unknown(options);
  const double sigma = 3e-4;
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0, sigma);
  for (int i = 0; i < 16; ++i) {
    const std::int64_t from = i * 300000000LL;
    const auto prior = integrateGyro(samples, from, from + 300000000, bias, options);
    // Fuse the prior with an independent rotation, as the estimator does.
    const Eigen::Matrix3d seen = expSo3(0.3 * rate) * expSo3({normal(random), normal(random), normal(random)});
    const Eigen::Matrix3d S = prior.covariance(),
                          gain = S * (S + sigma * sigma * Eigen::Matrix3d::Identity()).inverse();
    const Eigen::Matrix3d fused = prior.R * expSo3(gain * logSo3(prior.R.transpose() * seen));
    bias = refineBias(bias, prior, fused, S - gain * S);
  }
  const Eigen::Vector3d error = bias.mean - truth;
  EXPECT_LT(error.norm(), 0.002);
  EXPECT_LT(error.dot(bias.covariance.inverse() * error), 16);
}
} // namespace
