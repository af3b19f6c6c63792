// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "geometry/median.h"

namespace
{
using namespace bole;

TEST(Median, IsTheOneInTheMiddleOfAnOddCount)
{
  EXPECT_EQ(medianOf({5, -2, 9}), 5);
  EXPECT_EQ(centreOf({5, -2, 9}), 5);
  EXPECT_EQ(medianOf({7}), 7);
  EXPECT_EQ(centreOf({7}), 7);
}

TEST(Median, OfAnEvenCountIsTheUpperOneOrTheMeanOfTheTwo)
{
  EXPECT_EQ(medianOf({8, 1, 4, -3}), 4);
  EXPECT_EQ(centreOf({8, 1, 4, -3}), 2.5);
  EXPECT_EQ(centreOf({3, 3.5}), 3.25);
}

TEST(Median, OfNothingIsZeroTheCentreAndTheQuantileAreNoNumbers)
{
  EXPECT_EQ(medianOf({}), 0);
  EXPECT_TRUE(std::isnan(centreOf({})));
  EXPECT_TRUE(std::isnan(quantileOf({}, 0.5)));
}

TEST(Quantile, IsTheNearestRank)
{
  const std::vector<double> values{40, 10, 30, 20, 50};
  EXPECT_EQ(quantileOf(values, 0), 10);
  EXPECT_EQ(quantileOf(values, 0.3), 20); // rank 1.2
  EXPECT_EQ(quantileOf(values, 0.5), 30);
  EXPECT_EQ(quantileOf(values, 0.95), 50); // rank 3.8
  EXPECT_EQ(quantileOf(values, 1), 50);
}
} // namespace
