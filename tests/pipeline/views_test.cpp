// SPDX-License-Identifier: GPL-2.0-or-later
// What views of a trunk count for. One that is darker than what is behind it, and then brighter: what a drone sees that
// flies round it.
#include "support/drawn_trunks.h"

#include "pipeline/engine.h"

#include <cmath>
#include <gtest/gtest.h>

namespace bole
{
namespace
{
const PinholeCamera kCamera;
const Pose kMount = SmootherOptions::forwardCamera();
constexpr int kTurned = 40; ///< frame in which light and dark change places

/// Sideways to and fro before five trunks, with a pose filter that makes no errors.
Frame frameAt(int k)
{
  Frame frame;
  frame.stamp_ns = k * 100000000LL;
  frame.wMb_odometry = Pose(Eigen::Matrix3d::Identity(), {0, 0.8 * std::sin(0.15 * k), 1.2});
  frame.image = test::drawTrunks(kCamera, (*frame.wMb_odometry * kMount).inverse(), test::smallWood(), unsigned(k));
  if (k >= kTurned)
    for (unsigned i = 0; i < frame.image.getSize(); ++i)
      frame.image.bitmap[i] = static_cast<unsigned char>(255 - frame.image.bitmap[i]);
  return frame;
}

/// Confirmed trunks tracked in each of 60 frames.
std::vector<int> trackedWith(int turned_frames)
{
  StageOptions options;
  options.flow.turned_frames = turned_frames;
  Pipeline pipeline(kCamera, kMount, options);
  std::vector<int> tracked;
  for (int k = 0; k < 60; ++k) {
    int count = 0;
    for (const TrunkInView &trunk : pipeline.process(frameAt(k)).trunks)
      count += trunk.id < 5 && trunk.status == TrunkStatus::confirmed && trunk.is_tracked;
    tracked.push_back(count);
  }
  return tracked;
}

TEST(TurnedTrunk, IsTrackedOnAfterAsManyFramesAsAskedForAndNotBefore)
{
  const std::vector<int> tracked = trackedWith(3);
  ASSERT_GE(tracked[kTurned - 1], 2);
  EXPECT_EQ(tracked[kTurned], 0);
  EXPECT_EQ(tracked[kTurned + 1], 0);
  for (int k = kTurned + 2; k < 60; ++k)
    EXPECT_GE(tracked[static_cast<std::size_t>(k)], tracked[kTurned - 1] - 1) << k;
}

TEST(TurnedTrunk, IsAnotherEdgeWhereNobodyAsksForIt)
{
  const std::vector<int> tracked = trackedWith(0);
  ASSERT_GE(tracked[kTurned - 1], 2);
  for (int k = kTurned; k < kTurned + 8; ++k)
    EXPECT_EQ(tracked[static_cast<std::size_t>(k)], 0) << k;
}
/// Standard deviation of log r of the nearest trunk after 30 frames to and fro and \p rest frames at rest.
double radiusSigmaAfter(int rest, double view_correlation)
{
  StageOptions options;
  options.flow.view_correlation = view_correlation;
  Engine pipeline(kCamera, kMount, options);
  for (int k = 0; k < 30 + rest; ++k) {
    Frame frame = frameAt(std::min(k, 30));
    frame.stamp_ns = k * 100000000LL;
    pipeline.process(frame);
  }
  double sigma = -1, nearest = 1e9;
  for (const MapTrunk &trunk : pipeline.trunks().trunks())
    if (trunk.status == TrunkStatus::confirmed && !trunk.removed && trunk.trunk.xy.norm() < nearest) {
      nearest = trunk.trunk.xy.norm();
      sigma = std::sqrt(trunk.covariance(2, 2));
    }
  return sigma;
}

TEST(ViewCorrelation, OneViewSeenAgainAndAgainTeachesLittle)
{
  const double moved = radiusSigmaAfter(1, 0.05), each_counts = radiusSigmaAfter(40, 0),
               shared = radiusSigmaAfter(40, 0.05);
  ASSERT_GT(moved, 0);
  EXPECT_LT(each_counts, 0.85 * moved);
  EXPECT_GT(shared, 0.95 * moved);
}
} // namespace
} // namespace bole
