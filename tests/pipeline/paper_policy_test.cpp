// SPDX-License-Identifier: GPL-2.0-or-later
// map.policy = paper: what the paper says, and nothing else.
#include "support/drawn_trunks.h"

#include "pipeline/paper_policy.h"
#include <bole/config.h>
#include <bole/pipeline.h>

#include <Eigen/Cholesky>
#include <gmock/gmock.h>

namespace bole
{
namespace
{
const PinholeCamera kCamera;
const Pose kMount = SmootherOptions::forwardCamera();

StageOptions preset()
{
  Options options;
  readConfig(BOLE_SOURCE_DIR "/config/paper.yaml", options);
  return stageOptions(options, kCamera);
}

/// Each key of the preset beside the sentence of the paper that it follows. Who changes one has left the letter.
TEST(PaperPreset, IsThePaperToTheLetter)
{
  const StageOptions paper = preset();
  EXPECT_TRUE(paper.flow.as_paper);
  // 4: "z_t of the robot's odometry from an on-board pose filter", and p(x_1) "serves only to anchor"; no points (8)
  EXPECT_TRUE(paper.motion.relative_alone);
  EXPECT_FALSE(paper.flow.use_points);
  // 4.1: Eq. 3, "alpha ... 1000", parts convolved separately "with sigma = 3 pixels"
  EXPECT_EQ(paper.tracking.energy.form, EnergyForm::paper);
  EXPECT_EQ(paper.tracking.energy.paper_alpha, 1000);
  EXPECT_TRUE(paper.gradient.split);
  // 3: theta is x, y and r: trees stand upright; Eq. 2 is a product of likelihoods, none of them cut off
  EXPECT_LE(paper.smoothing.prior_lean_sigma, 1e-4);
  EXPECT_EQ(paper.smoothing.summary_loss.kind, LossKind::quadratic);
  EXPECT_FALSE(paper.smoothing.forgets);
  // 5: labels i.i.d., each from its own pixel; two consecutive frames; Eq. 13: mean 0 and V omega; one Gauss-Newton
  // update an M-step from the gyro
  const SaliencyOptions &s = paper.saliency;
  EXPECT_TRUE(paper.flow.use_saliency);
  EXPECT_EQ(s.label_window_px, 1);
  EXPECT_FALSE(s.use_translation);
  EXPECT_TRUE(s.foreground_mean_zero);
  EXPECT_TRUE(s.linear_flow);
  EXPECT_FALSE(s.use_rotation_prior);
  EXPECT_EQ(s.sigma_rotation_pull, 0);
  EXPECT_EQ(s.sample_correlation, 1);
  EXPECT_EQ(s.finest_level, 0);
  EXPECT_EQ(s.levels, 1);
  // 6: left borders on the negative part, right ones on the positive; "a fixed threshold ... 0.75"
  EXPECT_FALSE(paper.lines.either_polarity);
  EXPECT_EQ(paper.lines.threshold, 0.75);
  // 6: "parameters a and b by inspection of the statistics of the data", here those of data/park-forward
  EXPECT_NEAR(-paper.lines.border_b / paper.lines.border_a, 0.042, 1e-9);
  EXPECT_NEAR(-paper.lines.foreground_b / paper.lines.foreground_a, 0.574, 1e-9);
  // 7: a detection is a tree, and duplicates stay
  EXPECT_TRUE(paper.map.at_once);
}

TEST(PaperPreset, ChangesNothingOfTheDefaultsButThePolicy)
{
  Options options;
  readConfig(BOLE_SOURCE_DIR "/config/paper.yaml", options);
  EXPECT_EQ(options.map.policy, MapPolicy::paper);
  options.map.policy = MapPolicy::earned;
  EXPECT_EQ(toYaml(options), toYaml(Options()));
}

/// One frame after the other of drawn trees, all of it foreground.
struct Mapping
{
  StageOptions options = preset();
  Smoother smoother{options.smoothing};
  TrunkMap map{options.map};
  vpImage<float> all_near{240, 320, 0.f};

  Mapping() { smoother.addFirstPose(Pose(Eigen::Matrix3d::Identity(), {0, 0, 1.2}), 1e-6 * Matrix6d::Identity()); }

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
    const Eigen::Vector3d step(0, smoother.poseCount() % 4 < 2 ? 0.06 : -0.06, 0);
    smoother.addPose(Pose(Eigen::Matrix3d::Identity(), step), 1e-6 * Matrix6d::Identity());
    smoother.update();
    for (const std::size_t i : map.active())
      map.refresh({map.trunks()[i].id, smoother.trunk(map.trunks()[i].smoother_id), std::nullopt});
    const Viewpoint view{kCamera, smoother.pose(smoother.poseCount() - 1) * kMount, true, 0.0,
                         0.1 * static_cast<double>(smoother.poseCount())};
    return mapAsPaper(computeGradient(draw(view.wMc), options.gradient), &all_near, view, smoother, map, options);
  }
  int confirmed() const
  {
    int count = 0;
    for (const TrunkRecord &tree : map.records())
      count += tree.status == TrunkStatus::confirmed;
    return count;
  }
};

const std::vector<Cylinder> kOneTree = {test::uprightTrunk(4, 0.5, 0.2, 20)};

TEST(PaperPolicy, WhatIsFoundIsATreeAtOnce)
{
  Mapping mapping;
  mapping.see(kOneTree);
  ASSERT_EQ(mapping.map.active().size(), 1u);
  EXPECT_EQ(mapping.map.trunks()[0].status, TrunkStatus::confirmed);
  EXPECT_EQ(mapping.confirmed(), 1);
}

TEST(PaperPolicy, AWideningBaselineFindsTheRange)
{
  Mapping mapping;
  for (int k = 0; k < 12; ++k)
    mapping.see(kOneTree);
  ASSERT_EQ(mapping.map.active().size(), 1u);
  const Trunk trunk = mapping.smoother.trunk(mapping.map.trunks()[0].smoother_id);
  EXPECT_LT((trunk.xy - Eigen::Vector2d(4, 0.5)).norm(), 0.2);
  EXPECT_NEAR(trunk.radius(), 0.2, 0.04);
}

TEST(PaperPolicy, ATreeWhoseEnergyIsNotConvexEndsAndStaysInTheMap)
{
  Mapping mapping;
  mapping.see(kOneTree);
  const auto seen = mapping.seeNothing();
  ASSERT_EQ(seen.size(), 1u);
  EXPECT_FALSE(seen[0].is_tracked);
  EXPECT_STREQ(seen[0].outcome, "negative curvature");
  EXPECT_TRUE(mapping.map.active().empty());
  EXPECT_EQ(mapping.confirmed(), 1);
  EXPECT_TRUE(mapping.map.review(1e6).changes.empty());
  EXPECT_TRUE(mapping.map.reviewAll().changes.empty());
}

TEST(PaperPolicy, WhatIsFoundAgainIsAnotherTree)
{
  Mapping mapping;
  mapping.see(kOneTree);
  mapping.seeNothing();
  mapping.see(kOneTree);
  EXPECT_EQ(mapping.confirmed(), 2);
  EXPECT_EQ(mapping.map.active().size(), 1u);
}

TEST(PaperPolicy, ATreeThatIsObservedKeepsOthersOut)
{
  Mapping mapping;
  for (int k = 0; k < 5; ++k)
    mapping.see(kOneTree);
  EXPECT_EQ(mapping.confirmed(), 1);
}

TEST(PaperPolicy, ConvexifiedKeepsTheGradientAndAsksForNoMoreThanAPixel)
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

TEST(PaperPolicy, TheTurnThatSaliencyStartsFromIsTheGyros)
{
  Frame frame;
  frame.stamp_ns = 100000000;
  for (int k = 0; k <= 20; ++k)
    frame.gyro.push_back({k * 5000000LL, Eigen::Vector3d(0, 0, 0.5)});
  EXPECT_FALSE(gyroTurn(frame, {}, kMount, {}));
  const auto turn = gyroTurn(frame, {{0, Pose()}}, kMount, {});
  ASSERT_TRUE(turn);
  EXPECT_LT(logSo3((kMount.R.transpose() * expSo3({0, 0, 0.05}) * kMount.R).transpose() * turn->pRc).norm(), 1e-6);
}

TEST(PaperPolicy, TheMotionIsThePoseFiltersRelativePoseAlone)
{
  MotionModelOptions options;
  options.relative_alone = true;
  MotionModel model(options);
  Frame first, second;
  first.wMb_odometry = Pose(expSo3({0.1, 0.05, 1}), {1, 2, 3});
  second.wMb_odometry = Pose(expSo3({0.12, 0.03, 1.1}), {1.2, 2.1, 3.3});
  second.stamp_ns = 100000000;
  second.gyro = {{0, {0, 0, 5}}, {100000000, {0, 0, 5}}};
  EXPECT_LT(model.first(first).covariance.norm(), 1e-5);
  model.advance(first);
  const MotionStep step = model.step(second, *first.wMb_odometry, {}, Vector6d::Zero());
  EXPECT_LT((first.wMb_odometry->inverse() * *second.wMb_odometry).minus(step.aMb).norm(), 1e-12);
  EXPECT_FALSE(step.absolute);
  EXPECT_FALSE(step.turn_from_gyro);
}
} // namespace
} // namespace bole
