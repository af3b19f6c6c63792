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
} // namespace
