// SPDX-License-Identifier: GPL-2.0-or-later
// The paper's method on drawn trees: what the paper says, and nothing else.
#include "support/drawn_trunks.h"
#include "support/test.h"

#include "paper/paper_mapper.h"
#include "support/units.h"
#include <bole/smoother.h>

namespace
{
using namespace bole;
using namespace bole::paper;
using testing::IsEmpty;
using testing::SizeIs;

const PinholeCamera kCamera;
const Pose kMount = SmootherOptions::forwardCamera();

/// One frame after the other of drawn trees, from a camera that sways.
struct Mapping
{
  PaperMapper mapper{kCamera, kMount, kPrintedAlpha, LineQuartiles{0.02, 0.3}};
  Frame frame;
  std::vector<double> aside = {0, 0.06, 0.12, 0.18, 0.12, 0.06};

  std::vector<TrunkInView> see(const std::vector<Cylinder> &trees)
  {
    return look([&](const Pose &wMc) { return test::drawTrunks(kCamera, wMc.inverse(), trees); });
  }
  /// An image without any gradient.
  std::vector<TrunkInView> seeNothing()
  {
    return look([](const Pose &) { return vpImage<unsigned char>(240, 320, 128); });
  }
  template <typename Draw> std::vector<TrunkInView> look(const Draw &draw)
  {
    frame.wMb_odometry = Pose(Eigen::Matrix3d::Identity(), {0, aside[frame.index % aside.size()], 1.2});
    frame.image = draw(*frame.wMb_odometry * kMount);
    const FrameReport report = mapper.process(frame);
    ++frame.index;
    frame.stamp_ns += 100000000;
    return report.trunks;
  }
  std::size_t observed() const
  {
    const auto trees = mapper.map();
    return static_cast<std::size_t>(std::count_if(trees.begin(), trees.end(), [&](const TrunkRecord &tree) {
      return tree.last_seen_s > 1e-9 * static_cast<double>(frame.stamp_ns) - 0.15;
    }));
  }
};

const std::vector<Cylinder> kOneTree = {test::uprightTrunk(4, 0.5, 0.2, 20)};

TEST(PaperMapper, WhatIsFoundIsATreeAtOnce)
{
  Mapping mapping;
  EXPECT_THAT(mapping.see(kOneTree), IsEmpty()) << "without a frame before there is no saliency";
  EXPECT_THAT(mapping.see(kOneTree), SizeIs(1));
  ASSERT_THAT(mapping.mapper.map(), SizeIs(1));
  EXPECT_EQ(mapping.mapper.map()[0].status, TrunkStatus::confirmed);
}

TEST(PaperMapper, AWideningBaselineFindsTheRange)
{
  Mapping mapping;
  for (int k = 0; k < 12; ++k)
    mapping.see(kOneTree);
  mapping.mapper.finish();
  ASSERT_THAT(mapping.mapper.map(), SizeIs(1));
  const TrunkRecord tree = mapping.mapper.map()[0];
  EXPECT_LT((tree.xy - Eigen::Vector2d(4, 0.5)).norm(), 0.2);
  EXPECT_NEAR(tree.radius, 0.2, 0.04);
  EXPECT_EQ(tree.observations, 11) << "and is kept out of being found again";
  EXPECT_GT(tree.positionSigma(), 0.01);
  EXPECT_LT(tree.positionSigma(), 1);
}

TEST(PaperMapper, ATreeWhoseEnergyIsNotConvexEndsAndStaysInTheMap)
{
  Mapping mapping;
  mapping.see(kOneTree);
  mapping.see(kOneTree);
  const auto seen = mapping.seeNothing();
  ASSERT_THAT(seen, SizeIs(1));
  EXPECT_FALSE(seen[0].is_tracked);
  EXPECT_STREQ(seen[0].outcome, "negative curvature");
  EXPECT_THAT(mapping.seeNothing(), IsEmpty()) << "it is looked for no more";
  EXPECT_THAT(mapping.mapper.map(), SizeIs(1));
  mapping.see(kOneTree);
  mapping.see(kOneTree);
  EXPECT_THAT(mapping.mapper.map(), SizeIs(2)) << "what is found again is another tree";
  EXPECT_EQ(mapping.observed(), 1u);
}

TEST(PaperMapper, TheMotionIsThePoseFiltersRelativePoseAlone)
{
  Mapping mapping;
  for (int k = 0; k < 4; ++k) {
    mapping.frame.gyro = {{mapping.frame.stamp_ns - 100000000, {0, 0, 5}}, {mapping.frame.stamp_ns, {0, 0, 5}}};
    mapping.seeNothing();
  }
  const Trajectory path = mapping.mapper.smoothedTrajectory();
  ASSERT_THAT(path, SizeIs(4));
  for (std::size_t k = 0; k < path.size(); ++k)
    EXPECT_LT(path[k].wMb.minus(Pose(Eigen::Matrix3d::Identity(), {0, mapping.aside[k], 1.2})).norm(), 1e-6);
}

TEST(PaperMapper, RefusesAFrameWithoutAPoseOfThePoseFilter)
{
  PaperMapper mapper(kCamera, kMount, kPrintedAlpha, {});
  Frame frame;
  frame.image = vpImage<unsigned char>(240, 320, 128);
  EXPECT_THROW(mapper.process(frame), vpException);
}

TEST(PaperMapper, TheTurnThatSaliencyStartsFromIsTheGyros)
{
  std::vector<GyroSample> samples;
  for (int k = 0; k <= 20; ++k)
    samples.push_back({k * 5000000LL, Eigen::Vector3d(0, 0, 0.5)});
  const auto turn = gyroTurn(samples, 0, 100000000, kMount);
  ASSERT_TRUE(turn);
  EXPECT_LT(logSo3((kMount.R.transpose() * expSo3({0, 0, 0.05}) * kMount.R).transpose() * *turn).norm(), 1e-6);
  EXPECT_FALSE(gyroTurn({}, 0, 100000000, kMount));
  EXPECT_FALSE(gyroTurn(samples, 0, 300000000, kMount)) << "they end 0.2 s before";
}

TEST(PaperMapper, ConvexifiedKeepsTheGradientAndAsksForNoMoreThanAPixel)
{
  SummaryFactor summary;
  summary.f << 30, -2, 8, 1;
  summary.F = Vector4d(5, -3, 0, 2).asDiagonal();
  summary.F(0, 3) = summary.F(3, 0) = 4;
  const Vector4d steps(0.01, 0.1, 0.005, 0.1);
  EXPECT_FALSE(isConvex(summary, steps));
  const SummaryFactor convex = convexified(summary, steps);
  EXPECT_TRUE(isConvex(convex, steps));
  EXPECT_EQ(convex.f, summary.f);
  EXPECT_LE((-convex.F.ldlt().solve(convex.f)).cwiseQuotient(steps).norm(), 2 + 1e-9); // a pixel each way
}
} // namespace
