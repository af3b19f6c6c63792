// SPDX-License-Identifier: GPL-2.0-or-later
#include "vector_loops.h"

#include <gtest/gtest.h>

std::vector<double> outputsOfPlainLoops();

namespace
{
TEST(VectorLoops, GiveTheSameToRoundingOnEveryMachine)
{
  const std::vector<double> here = bole::LoopOutputs().all(), plain = outputsOfPlainLoops();
  ASSERT_EQ(here.size(), plain.size());
  double most = 0;
  for (std::size_t i = 0; i < here.size(); ++i) {
    ASSERT_TRUE(std::isfinite(here[i])) << i;
    EXPECT_NEAR(here[i], plain[i], 1e-4 * (1 + std::abs(plain[i]))) << i;
    most = std::max(most, std::abs(plain[i]));
  }
  EXPECT_GT(most, 10); // something was summed
}
} // namespace
