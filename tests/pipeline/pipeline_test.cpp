// SPDX-License-Identifier: GPL-2.0-or-later
// The pipeline as a user calls it.
#include "support/drawn_trunks.h"

#include "pipeline/stage_options.h"
#include "pipeline/units.h"
#include <bole/pipeline.h>

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
const PinholeCamera kCamera;
const Pose kMount = SmootherOptions::forwardCamera();

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

TEST(Pipeline, FindsAThinLeaningTrunkWhenAllFramesAreKnown) { findThinLeaningTrunk(Options(), 30); }

TEST(Pipeline, FindsAThinLeaningTrunkInServoing)
{
  Options options;
  options.stages.servoing = true;
  findThinLeaningTrunk(options, 60);
}

TEST(Pipeline, OfWhatIsNoTrunkItTellsWhy)
{
  Pipeline pipeline(kCamera, kMount);
  for (int k = 0; k < 30; ++k)
    pipeline.process(byHand(k));
  pipeline.finish();
  for (const TrunkRecord &trunk : pipeline.map())
    EXPECT_EQ(trunk.status == TrunkStatus::confirmed, trunk.reject_reason == RejectReason::none)
        << toString(trunk.reject_reason);
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

TEST(Units, OptionsAndReadingsAreInversesOfEachOther)
{
  const StageOptions metres;
  const StageOptions units = inUnits(metres, 2.5);
  EXPECT_NEAR(units.detection.range_max * 2.5, metres.detection.range_max, 1e-12);
  EXPECT_NEAR(units.map.usual_radius * 2.5, metres.map.usual_radius, 1e-12);
  Trunk trunk;
  trunk.xy = {2, -1};
  EXPECT_NEAR(inMetres(trunk, 2.5).radius(), 2.5 * trunk.radius(), 1e-12);
  EXPECT_NEAR(inMetres(trunk, 2.5).xy.x(), 5, 1e-12);
  const Pose wMb(Eigen::Matrix3d::Identity(), {1, 2, 3}), bMc(kMount.R, {0.1, 0, 0.05});
  EXPECT_LT(((inMetres(wMb, bMc, 2.5) * bMc).t - 2.5 * (wMb * bMc).t).norm(), 1e-12);
}

TEST(Units, WhatACameraSeesOfATrunkDoesNotDependOnTheUnit)
{
  const Pose wMb(Eigen::Matrix3d::Identity(), {1, 0.2, 1.3});
  Trunk trunk;
  trunk.xy = {5, 1};
  const RelativeTrunk before = relativeTrunk(wMb, kMount, trunk);
  const RelativeTrunk after = relativeTrunk(inMetres(wMb, kMount, 0.7), kMount, inMetres(trunk, 0.7));
  EXPECT_LT(before.minus(after).norm(), 1e-12);
}
} // namespace
} // namespace bole
