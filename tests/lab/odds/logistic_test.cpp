// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/odds/logistic.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace bole
{
namespace
{
/// Draws with known weights: 2 on the first term, nothing on the second, -1 for the constant.
class Logistic : public testing::Test
{
protected:
  void SetUp() override
  {
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform;
    for (int i = 0; i < kCount; ++i) {
      m_terms.row(i) << normal(random), normal(random), 1;
      m_truth(i) = uniform(random) < 1 / (1 + std::exp(1 - 2 * m_terms(i, 0))) ? 1 : 0;
    }
  }
  static constexpr int kCount = 5000;
  Eigen::MatrixXd m_terms = Eigen::MatrixXd(kCount, 3);
  Eigen::VectorXd m_truth = Eigen::VectorXd(kCount);
};

TEST_F(Logistic, FindsTheWeightsThatDrewTheData)
{
  const Eigen::VectorXd w = fitLogistic(m_terms, m_truth);
  EXPECT_NEAR(w(0), 2, 0.2);
  EXPECT_NEAR(w(1), 0, 0.1);
  EXPECT_NEAR(w(2), -1, 0.15);
}

TEST_F(Logistic, WhatItSaysIsAsOftenTrue)
{
  const Eigen::VectorXd log_odds = m_terms * fitLogistic(m_terms, m_truth);
  for (const ReliabilityBin &bin : reliability(log_odds, m_truth))
    EXPECT_NEAR(bin.said, bin.was, 4 * std::sqrt(0.25 / bin.count));
}

TEST(AreaUnderRoc, IsOneForAPerfectOrderAndAHalfForNone)
{
  const Eigen::Vector4d log_odds(1, 2, 3, 4);
  EXPECT_EQ(areaUnderRoc(log_odds, Eigen::Vector4d(0, 0, 1, 1)), 1);
  EXPECT_EQ(areaUnderRoc(log_odds, Eigen::Vector4d(0, 1, 1, 0)), 0.5);
}
} // namespace
} // namespace bole
