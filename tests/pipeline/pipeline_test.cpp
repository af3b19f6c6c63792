// SPDX-License-Identifier: GPL-2.0-or-later
// The pipeline as a user calls it.
#include "support/drawn_trunks.h"
#include "support/test.h"

#include "pipeline/engine.h"
#include "pipeline/stage_options.h"
#include "pipeline/units.h"
#include <bole/pipeline.h>

using namespace bole;

namespace
{
const PinholeCamera kCamera;
const Pose kMount = SmootherOptions::forwardCamera();

/// Sideways to and fro before trunks, with a pose filter that makes no errors.
Frame byHand(int k, const std::vector<Cylinder> &wood = test::smallWood())
{
  Frame frame; // its index is left alone
  frame.stamp_ns = k * 100000000LL;
  frame.wMb_odometry = Pose(Eigen::Matrix3d::Identity(), {0, 0.8 * std::sin(0.15 * k), 1.2});
  frame.image = test::drawTrunks(kCamera, (*frame.wMb_odometry * kMount).inverse(), wood, unsigned(k));
  return frame;
}

TEST(Pipeline, MapsFromFramesFilledByHandWithImageStampAndOdometry)
{
  Pipeline pipeline(kCamera, kMount);
  FrameReport report;
  for (int k = 0; k < 30; ++k) {
    report = pipeline.process(byHand(k));
    EXPECT_EQ(report.index, static_cast<std::size_t>(k));
  }
  pipeline.finish();
  int found = 0;
  for (const TrunkRecord &trunk : pipeline.map())
    for (const Cylinder &truth : test::smallWood())
      found += trunk.status == TrunkStatus::confirmed && (trunk.xy - truth.foot.head<2>()).norm() < 0.3;
  EXPECT_GE(found, 3);
  EXPECT_FALSE(report.trunks.empty());
  EXPECT_FALSE(report.map.empty());
  for (const TrunkRecord &trunk : pipeline.map()) // and of what is no trunk it tells why
    EXPECT_EQ(trunk.status == TrunkStatus::confirmed, trunk.reject_reason == RejectReason::none)
        << toString(trunk.reject_reason);
}

TEST(Pipeline, AFrameOfBeforeIsReviewedWithTheMapAndThePathThatTheFlightEndedWith)
{
  constexpr std::size_t kFrames = 30;
  Pipeline pipeline(kCamera, kMount);
  for (std::size_t k = 0; k < kFrames; ++k)
    pipeline.process(byHand(static_cast<int>(k)));
  pipeline.finish();
  const Trajectory smoothed = pipeline.smoothedTrajectory();
  std::map<int, TrunkRecord> map;
  for (const TrunkRecord &trunk : pipeline.map())
    if (trunk.status == TrunkStatus::confirmed)
      map[trunk.id] = trunk;
  ASSERT_GE(map.size(), 3u);
  std::map<int, int> views;
  for (std::size_t k = 0; k < kFrames; ++k) {
    const FrameReport report = pipeline.review(k);
    EXPECT_EQ(report.index, k);
    EXPECT_EQ(report.stamp_ns, smoothed[k].stamp_ns);
    EXPECT_LT(report.wMb.minus(smoothed[k].wMb).norm(), 1e-12);
    for (const TrunkInView &seen : report.trunks) {
      ASSERT_EQ(map.count(seen.id), 1u);
      EXPECT_EQ(seen.status, TrunkStatus::confirmed);
      views[seen.id] += seen.is_tracked;
      const Trunk trunk = knownTrunk(report, seen.id)->trunk;
      const double breast_z = map[seen.id].ground_z + kBreastHeight;
      EXPECT_LT((trunk.axisAt(breast_z).head<2>() - map[seen.id].xy).norm(), 1e-9);
      EXPECT_NEAR(seen.distance, (trunk.axisAt(report.wMc.t.z()) - report.wMc.t).head<2>().norm(), 1e-9);
    }
  }
  for (const auto &[id, trunk] : map) // also in the first frames, when nothing was known of it
    EXPECT_GE(views[id], trunk.observations) << id;
  EXPECT_THROW(pipeline.review(kFrames), vpException);
}

TEST(Pipeline, MeasuresTheRateOfItsFrames)
{
  Options told;
  told.camera.rate = 30;
  Pipeline measures(kCamera, kMount), knows(kCamera, kMount, told);
  for (int k = 0; k < 20; ++k) {
    Frame frame = byHand(k);
    frame.stamp_ns = k * 33'333'333LL;
    const FrameReport by_measure = measures.process(frame), by_option = knows.process(frame);
    EXPECT_EQ(by_measure.index, static_cast<std::size_t>(k));
    if (k >= 4) { // intervals have been seen
      EXPECT_LT((by_measure.wMb.t - by_option.wMb.t).norm(), 1e-12) << k;
    }
  }
  EXPECT_EQ(measures.smoothedTrajectory().size(), 20U);
}

TEST(Pipeline, AnOdometryThatBeginsAfterTheImagesIsNamed)
{
  Pipeline pipeline(kCamera, kMount);
  FrameReport report;
  for (int k = 0; k < 8; ++k) {
    Frame frame = byHand(k);
    if (k < 5)
      frame.wMb_odometry.reset();
    report = pipeline.process(frame);
    EXPECT_EQ(report.verdicts.size(), k < 5 ? 0U : 1U);
  }
  ASSERT_EQ(report.verdicts.size(), 1U);
  EXPECT_EQ(report.verdicts[0].text, "odometry: begins at 0.5 s, after the images, and is not used");
}

/// Its borders are smeared over upright lines, the only ones that the detector looks along in flight but for servoing.
void findThinLeaningTrunk(const Options &options, int frames)
{
  constexpr double kLean = 0.1;
  std::vector<Cylinder> wood = test::smallWood();
  Cylinder &leaning = wood[1];
  leaning.radius = 0.1;
  leaning.top.y() += kLean * leaning.top.z();
  Pipeline pipeline(kCamera, kMount, options);
  for (int k = 0; k < frames; ++k)
    pipeline.process(byHand(k, wood));
  pipeline.finish();
  const Eigen::Vector2d at_breast = leaning.foot.head<2>() + Eigen::Vector2d(0, kLean * kBreastHeight);
  int found = 0;
  for (const TrunkRecord &trunk : pipeline.map())
    if (trunk.status == TrunkStatus::confirmed && (trunk.xy - at_breast).norm() < 0.15) {
      ++found;
      EXPECT_GT(trunk.lean.y(), 0.05);
      EXPECT_NEAR(trunk.radius, leaning.radius, 0.01);
    }
  EXPECT_EQ(found, 1);
}

TEST(Pipeline, FindsAThinLeaningTrunkWhenAllFramesAreKnownAndInServoing)
{
  findThinLeaningTrunk(Options(), 30);
  Options options;
  options.stages.servoing = true;
  findThinLeaningTrunk(options, 60);
}

TEST(Pipeline, AFrameThatIsNotOkKeepsItsReasonAndItsPose)
{
  Pipeline pipeline(kCamera, kMount);
  pipeline.process(byHand(0));
  Frame broken = byHand(1);
  broken.status = FrameStatus::corrupt;
  broken.message = "half of it is missing";
  const FrameReport report = pipeline.process(broken);
  EXPECT_EQ(report.frame_status, FrameStatus::corrupt);
  EXPECT_EQ(report.reason, broken.message);
  EXPECT_TRUE(report.trunks.empty());
  EXPECT_LT((report.wMb.t - broken.wMb_odometry->t).norm(), 0.05);
}

TEST(Pipeline, BeforeAnyFrameThereIsNothing)
{
  Pipeline pipeline(kCamera, kMount);
  pipeline.finish();
  EXPECT_TRUE(pipeline.map().empty());
  EXPECT_TRUE(pipeline.smoothedTrajectory().empty());
}

TEST(Units, WhatACameraSeesOfATrunkDoesNotDependOnTheUnit)
{
  const Pose wMb(Eigen::Matrix3d::Identity(), {1, 0.2, 1.3});
  const Trunk trunk{{5, 1}};
  const RelativeTrunk before = relativeTrunk(wMb, kMount, trunk);
  const RelativeTrunk after = relativeTrunk(inMetres(wMb, kMount, 0.7), kMount, inMetres(trunk, 0.7));
  EXPECT_LT(before.minus(after).norm(), 1e-12);
}

// What views of a trunk count for. One that is darker than what is behind it, and then brighter: what a drone sees that
// flies round it.

constexpr int kTurned = 40; ///< frame in which light and dark change places

Frame turnedFrame(int k)
{
  Frame frame = byHand(k);
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
    for (const TrunkInView &trunk : pipeline.process(turnedFrame(k)).trunks)
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
    Frame frame = byHand(std::min(k, 30));
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
