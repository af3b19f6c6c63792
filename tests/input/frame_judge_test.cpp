// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/open_source.h>

#include <gtest/gtest.h>

#include <cmath>
#include <random>

using namespace bole;

namespace
{
/// The gaps that are told of frames that come after these intervals [s].
std::vector<double> gapsOf(const std::vector<double> &intervals_s, FrameStatus status = FrameStatus::ok)
{
  PinholeCamera camera;
  camera.fx = camera.fy = 50;
  FrameJudge health(camera, Pose());
  std::vector<double> gaps;
  double time_s = 7;
  for (std::size_t i = 0; i <= intervals_s.size(); ++i) {
    Frame frame;
    time_s += i > 0 ? intervals_s[i - 1] : 0;
    frame.stamp_ns = std::llround(1e9 * time_s);
    frame.status = status;
    frame.image.resize(48, 64);
    for (int v = 0; v < 48; ++v)
      for (int u = 0; u < 64; ++u)
        frame.image[v][u] = static_cast<unsigned char>(128 + 60 * std::sin(0.3 * u + time_s) * std::cos(0.2 * v));
    health.judge(frame);
    if (frame.gap_s > 0)
      gaps.push_back(frame.gap_s);
    EXPECT_EQ(frame.gap_s > 0, frame.message.rfind("no picture for", 0) == 0) << frame.message;
  }
  return gaps;
}

std::vector<double> steady(std::size_t count, double interval_s) { return std::vector<double>(count, interval_s); }
} // namespace

TEST(FrameJudge, TellsOfATimeWithoutAPicture)
{
  std::vector<double> intervals = steady(40, 0.1);
  intervals[20] = 2.1;
  const std::vector<double> gaps = gapsOf(intervals);
  ASSERT_EQ(gaps.size(), 1u);
  EXPECT_NEAR(gaps[0], 2.1, 1e-9);
}

TEST(FrameJudge, APauseAfterEachBurstIsAGap)
{
  std::vector<double> intervals = steady(60, 0.1);
  intervals[20] = intervals[30] = intervals[40] = intervals[50] = 1;
  EXPECT_EQ(gapsOf(intervals).size(), 4u);
}

TEST(FrameJudge, AGapThatTheSourceFillsWithMissingFramesIsNoneOnceMore)
{
  std::vector<double> intervals = steady(40, 0.1);
  intervals[20] = 2.1;
  EXPECT_TRUE(gapsOf(intervals, FrameStatus::missing).empty());
}

TEST(FrameJudge, ACameraOfAnyRateThatVariesHasNoGap)
{
  std::mt19937 random(1);
  for (const double usual_s : {0.01, 0.033, 0.1, 0.4, 1.0, 5.0}) {
    std::vector<double> intervals;
    for (int i = 0; i < 500; ++i) // between the usual rate and a third more than twice as slow
      intervals.push_back(usual_s * std::uniform_real_distribution<double>(1, 2.3)(random));
    EXPECT_TRUE(gapsOf(intervals).empty()) << usual_s;
  }
}

TEST(FrameJudge, ACameraThatGoesOnAtAnotherRateHasNoGapAtFourFrames)
{
  std::vector<double> intervals = steady(20, 0.1);
  const std::vector<double> slow = steady(100, 0.4);
  intervals.insert(intervals.end(), slow.begin(), slow.end());
  EXPECT_TRUE(gapsOf(intervals).empty());
}

TEST(FrameJudge, ACameraThatGoesOnVerySlowlyIsToldOnlyUntilThatIsUsual)
{
  std::vector<double> intervals = steady(20, 0.1);
  const std::vector<double> slow = steady(100, 1);
  intervals.insert(intervals.end(), slow.begin(), slow.end());
  const std::size_t gaps = gapsOf(intervals).size();
  EXPECT_GE(gaps, 1u);
  EXPECT_LE(gaps, 8u);
}
