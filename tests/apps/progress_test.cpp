// SPDX-License-Identifier: GPL-2.0-or-later
#include "progress.h"

#include <gmock/gmock.h>

namespace
{
using bole::Progress;
using testing::HasSubstr;

TEST(Progress, TellsWhereItIsAndHowLongItWillTake)
{
  EXPECT_EQ(Progress::text(50, 200, 10, "frame", ""),
            "[#######.....................] frame 50 of 200  5.0 frames/s  0:30 left");
  EXPECT_EQ(Progress::text(50, 0, 10, "frame", "stale"), "frame 50  5.0 frames/s  stale");
  EXPECT_THAT(Progress::text(1, 5000, 2, "flight", ""), HasSubstr("flight 1 of 5000  0.5 flights/s  2:46:38 left"));
  EXPECT_THAT(Progress::text(300, 200, 1, "frame", ""),
              testing::AllOf(testing::StartsWith("[############################] "), testing::Not(HasSubstr("left"))));
}

TEST(Progress, PrintsNothingWhereThereIsNoTerminal)
{
  std::FILE *file = std::tmpfile();
  {
    Progress progress(20, file);
    for (std::size_t i = 1; i <= 20; ++i)
      progress.update(i, "ok");
  }
  EXPECT_EQ(std::ftell(file), 0);
  std::fclose(file);
}
} // namespace
