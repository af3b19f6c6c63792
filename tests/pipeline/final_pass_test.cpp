// SPDX-License-Identifier: GPL-2.0-or-later
#include "detection/drawn_trunks.h"
#include "support/test.h"

#include "pipeline/consistency_window.h"
#include "pipeline/final_pass.h"

namespace
{
using namespace bole;

constexpr double kFarthest = 14, kRadiusMax = 0.38;
const test::DrawnTrunk kWhole{3.55, 0.3, 0.18, 60};

Trunk trunkAt(double x, double y, double radius) { return {{x, y}, std::log(radius)}; }

ScoredHypothesis judgedAt(int id, const Trunk &trunk, double log_odds)
{
  ScoredHypothesis scored;
  scored.id = id;
  scored.trunk = trunk;
  scored.log_odds = log_odds;
  return scored;
}

/// A camera that moves sideways past what stands along x.
struct Path
{
  std::vector<ColumnImage> images;
  std::vector<ColumnView> views;

  Path() : images(10)
  {
    const Pose forward = SmootherOptions::forwardCamera();
    for (std::size_t i = 0; i < images.size(); ++i) {
      images[i].cRl = forward.R.transpose();
      images[i].q_first = -0.8;
      images[i].value[0].resize(321);
      views.emplace_back(images[i], Pose(forward.R, {0, 0.05 * static_cast<double>(i), 1.2}));
    }
  }
};

std::vector<int> idsOf(const std::vector<ScoredHypothesis> &scored)
{
  std::vector<int> ids;
  for (const ScoredHypothesis &one : scored)
    ids.push_back(one.id);
  return ids;
}

TEST(FinalPass, OfTwoInOnePlaceTheLikelierStays)
{
  const Path path;
  const auto chosen = chooseSet({judgedAt(1, trunkAt(4, 0, 0.15), 1), judgedAt(2, trunkAt(4.2, 0.1, 0.12), 3),
                                 judgedAt(3, trunkAt(4, 2, 0.15), 0.5), judgedAt(4, trunkAt(5, -2, 0.15), -2)},
                                0, 0.3, path.views, 14);
  EXPECT_THAT(idsOf(chosen), testing::ElementsAre(2, 3));
}

TEST(FinalPass, TwoReadingsOfTheSameColumnsAtTwoRangesAreOne)
{
  const Path path;
  const Trunk near = trunkAt(4, 0.2, 0.15), far = trunkAt(5, 0.2, 0.1875); // the same lines, a metre apart
  EXPECT_THAT(idsOf(chooseSet({judgedAt(1, near, 1), judgedAt(2, far, 2)}, 0, 0.3, path.views, 14)),
              testing::ElementsAre(2));
  const Trunk behind = trunkAt(7, 0.2, 0.1); // partly hidden by the near one in some views, narrower
  EXPECT_THAT(idsOf(chooseSet({judgedAt(1, near, 2), judgedAt(2, behind, 1)}, 0, 0.3, path.views, 14)),
              testing::ElementsAre(1, 2));
}

/// The likeliest in a place is none when it is looked at closely; the next best one there is.
TEST(FinalPass, WhatDoesNotBearACloserLookMakesRoomForItsRivals)
{
  const Path path;
  const std::vector<ScoredHypothesis> scored = {
      judgedAt(1, trunkAt(4, 0, 0.15), 2), judgedAt(2, trunkAt(4.2, 0.1, 0.12), 1),
      judgedAt(3, trunkAt(4.1, 0, 0.2), 0), judgedAt(4, trunkAt(4, 2, 0.15), 1),
      judgedAt(5, trunkAt(5, -2, 0.15), kMayBeTrunk - 1)};
  std::vector<std::vector<int>> looked_at;
  const auto again = scoreBestAgain(scored, 0.3, path.views, 14, [&](const auto &untried, const auto &) {
    looked_at.push_back(idsOf(untried));
    std::vector<std::optional<ScoredHypothesis>> results;
    for (const ScoredHypothesis &one : untried)
      results.push_back(one.id == 1 ? std::nullopt : std::optional(judgedAt(one.id, one.trunk, one.log_odds + 0.5)));
    return results;
  });
  EXPECT_THAT(looked_at, testing::ElementsAre(testing::ElementsAre(1, 4), testing::ElementsAre(2)));
  EXPECT_THAT(idsOf(again), testing::UnorderedElementsAre(2, 3, 4, 5));
  EXPECT_THAT(idsOf(chooseSet(again, 0, 0.3, path.views, 14)), testing::UnorderedElementsAre(2, 4));
}

TEST(FinalPass, AStripOfAFacadeIsNoTrunkHoweverClearItsBordersAre)
{
  const test::DrawnTrunk one{4, 0.4, 0.15, 40};
  const auto weighed = [&](const test::LevelFlight &flight, double points_beside,
                           std::optional<double> continuity = {}) {
    ScoredHypothesis scored = judgedAt(1, test::trunkOf(one), 4);
    scored.points_beside = points_beside;
    weighAgainstSurface(scored, flight.views(), kFarthest, continuity);
    return scored.log_odds;
  };
  const test::LevelFlight free({one}, test::sweep()), facade(test::facadeAround(one), test::sweep());
  EXPECT_GT(weighed(free, 0), 2);
  EXPECT_LT(weighed(facade, 0), 0);
  EXPECT_LT(weighed(free, -8), 0);     // points beside it lie at its range,
  EXPECT_GT(weighed(facade, 6), 0);    // or behind it
  EXPECT_LT(weighed(free, 0, 0.6), 0); // what it shows goes on beside it, or does not
  EXPECT_GT(weighed(free, 0, 0.05), 2);
}

/// Only the lit part of a trunk is read.
TEST(FinalPass, AWiderReadingMustTakeInWhatStoodBesideTheBorder)
{
  const test::DrawnTrunk &whole = kWhole, lit{3.42, 0.39, 0.09, 0};
  const test::LevelFlight flight(test::barkOf(whole, 0), test::sweep());
  const std::vector<ColumnView> views = flight.views();
  const ScoredHypothesis narrow = judgedAt(1, test::trunkOf(lit), 3);
  const auto proposal = proposeBorders({1, narrow.trunk}, views, kFarthest, kRadiusMax);
  ASSERT_TRUE(proposal.has_value());
  EXPECT_NEAR(proposal->guess.trunk.radius(), whole.radius, 0.02);
  EXPECT_NEAR(proposal->guess.trunk.xy.y(), whole.y, 0.02);
  EXPECT_FALSE(proposeBorders({1, narrow.trunk}, views, kFarthest, 0.1).has_value()); // wider than any trunk
  ScoredHypothesis wide = judgedAt(1, test::trunkOf(whole), 2.8);
  EXPECT_FALSE(proposeBorders({1, wide.trunk}, views, kFarthest, kRadiusMax).has_value()); // it ends there
  EXPECT_TRUE(isBetterSilhouette(wide, narrow, *proposal, views, kFarthest));
  wide.log_odds = -2;
  EXPECT_FALSE(
      isBetterSilhouette(wide, narrow, *proposal, views, kFarthest)); // less of a trunk than depth makes up for
  EXPECT_FALSE(isBetterSilhouette(narrow, narrow, *proposal, views, kFarthest));
}

/// A rim of light of less than two pixels is left out.
TEST(FinalPass, ForSteeringAPixelBeyondABorderIsEnoughToLookThere)
{
  const test::DrawnTrunk &whole = kWhole, without_rim{3.55, 0.3115, 0.1685, 0};
  const test::LevelFlight flight(test::barkOf(whole, 0), test::sweep());
  const std::vector<ColumnView> views = flight.views();
  const auto scored = scoreHypothesis({1, test::trunkOf(without_rim), 3}, views, kFarthest);
  const auto right = scoreHypothesis({1, test::trunkOf(whole), 3}, views, kFarthest);
  ASSERT_TRUE(scored && right);
  EXPECT_FALSE(proposeBorders({1, scored->trunk}, views, kFarthest, kRadiusMax).has_value());
  const auto proposal = proposeBorders({1, scored->trunk}, views, kFarthest, kRadiusMax, 1);
  ASSERT_TRUE(proposal.has_value());
  EXPECT_NEAR(proposal->guess.trunk.radius(), whole.radius, 0.01);
  EXPECT_NEAR(proposal->guess.trunk.xy.y(), whole.y, 0.01);
  EXPECT_LT(silhouetteScore(*scored) + 0.05, silhouetteScore(*right));
}

/// A reading with a border of something behind is too wide, one half beside the trunk is as wide as it was known to be.
TEST(FinalPass, AReadingOfTheBackgroundIsMovedOntoTheTrunk)
{
  const test::DrawnTrunk &whole = kWhole, wide{3.55, 0.37, 0.25, 0}, beside{3.55, 0.43, 0.18, 0};
  const test::LevelFlight flight(test::barkOf(whole, -1), test::sweep());
  const std::vector<ColumnView> views = flight.views();
  for (const test::DrawnTrunk &hypothesis : {wide, beside}) {
    const auto scored = scoreHypothesis({1, test::trunkOf(hypothesis), 3}, views, kFarthest);
    ASSERT_TRUE(scored.has_value());
    EXPECT_TRUE(isBackgroundInside(scored->evidence));
    const auto proposal = proposeBorders({1, scored->trunk}, views, kFarthest, kRadiusMax);
    ASSERT_TRUE(proposal.has_value());
    EXPECT_NEAR(proposal->guess.trunk.radius(), whole.radius, 0.02);
    EXPECT_NEAR(proposal->guess.trunk.xy.y(), whole.y, 0.03);
    EXPECT_TRUE(isBetterSilhouette(*scoreHypothesis({1, proposal->guess.trunk, 3}, views, kFarthest), *scored,
                                   *proposal, views, kFarthest));
  }
  const auto right = scoreHypothesis({1, test::trunkOf(whole), 3}, views, kFarthest);
  ASSERT_TRUE(right.has_value());
  EXPECT_FALSE(isBackgroundInside(right->evidence));
}

/// A reading that leaves a rim of a pixel and a half out on the right.
TEST(FinalPass, DepthHasItsShareInWhereATrunkEnds)
{
  const test::DrawnTrunk &whole = kWhole, without_rim{3.55, 0.3115, 0.1685, 0};
  const test::LevelFlight flight(test::barkOf(whole, 0), test::sweep());
  const std::vector<ColumnView> views = flight.views();
  const Matrix5d sure = 1e-6 * Matrix5d::Identity();
  const TrunkEstimate mended = fuseDepthBorders({1, test::trunkOf(without_rim), sure}, views, kFarthest);
  EXPECT_GT(mended.trunk.radius(), without_rim.radius + 0.003);
  EXPECT_LT(mended.trunk.radius(), whole.radius);
  EXPECT_LT(mended.trunk.xy.y(), without_rim.y - 0.003);
  EXPECT_GT(mended.trunk.xy.y(), whole.y);
  EXPECT_NEAR(mended.trunk.xy.x(), whole.x, 0.003) << "its range is told by other means";
  const Matrix5d wider = *mended.covariance - sure;
  EXPECT_GT(wider(1, 1), std::pow(0.004, 2));
  EXPECT_LT(wider(1, 1), std::pow(0.02, 2));
  EXPECT_NEAR(wider(2, 2), wider(1, 1) / std::pow(mended.trunk.radius(), 2), 0.1 * wider(2, 2));
  const TrunkEstimate right = fuseDepthBorders({1, test::trunkOf(whole), sure}, views, kFarthest);
  EXPECT_NEAR(right.trunk.radius(), whole.radius, 0.005);
  EXPECT_NEAR(right.trunk.xy.y(), whole.y, 0.005);
  EXPECT_LT((*right.covariance - sure)(1, 1), wider(1, 1));
  const TrunkEstimate unseen = fuseDepthBorders({1, test::trunkOf(whole), sure}, {}, kFarthest);
  EXPECT_TRUE(unseen.trunk.minus(test::trunkOf(whole)).isZero(0));
  EXPECT_TRUE((*unseen.covariance - sure).isZero(0));
}

/// The same lines in the images, a twelfth too near and too far.
TEST(FinalPass, TheBarkTellsHowFarATrunkStands)
{
  const test::DrawnTrunk &whole = kWhole;
  const test::LevelFlight flight(test::barkOf(whole, -1), test::sweep());
  const std::vector<ColumnView> views = flight.views();
  EXPECT_FALSE(proposeRange({1, test::trunkOf(whole)}, views, kFarthest, kRadiusMax).has_value());
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const ColumnView &view : views)
    middle += view.position / static_cast<double>(views.size());
  for (const double scale : {1 / 1.08, 1.08}) {
    Hypothesis hypothesis{1, test::trunkOf(whole)};
    hypothesis.trunk.xy = middle + scale * (hypothesis.trunk.xy - middle);
    hypothesis.trunk.log_radius += std::log(scale);
    const auto guess = proposeRange(hypothesis, views, kFarthest, kRadiusMax);
    ASSERT_TRUE(guess.has_value()) << scale;
    EXPECT_LT((guess->trunk.xy - test::trunkOf(whole).xy).norm(), 0.06) << scale;
    EXPECT_NEAR(guess->trunk.radius(), whole.radius, 0.004) << scale;
    EXPECT_FALSE(proposeRange(hypothesis, views, kFarthest, 0.17).has_value()) << "thicker than any trunk";
    const Trunk between = fuseTextureRange(hypothesis.trunk, views, kFarthest);
    EXPECT_LT((between.xy - 0.5 * (hypothesis.trunk.xy + guess->trunk.xy)).norm(), 0.02) << "as sure as its borders";
    EXPECT_NEAR(between.radius() / (between.xy - middle).norm(),
                hypothesis.trunk.radius() / (hypothesis.trunk.xy - middle).norm(), 1e-9)
        << "as wide in the images";
  }
}

TEST(FinalPass, TheAlbumIsBounded)
{
  KeyframeStore keyframes;
  const vpImage<unsigned char> image(4000, 4000, 90); // 16 MB each
  for (std::size_t i = 0; i < 40; ++i)
    keyframes.add(image, ColumnImage(), i, 0.1 * static_cast<double>(i));
  EXPECT_GE(keyframes.frames().size(), 8u);
  EXPECT_LE(keyframes.frames().size(), 17u);
  for (std::size_t i = 1; i < keyframes.frames().size(); ++i)
    EXPECT_GT(keyframes.frames()[i].pose, keyframes.frames()[i - 1].pose);
  EXPECT_GE(keyframes.frames().back().pose, 30u); // the end of the flight is kept too
}

TEST(ConsistencyWindow, TakesFramesFromPlacesApartAndForgetsTheOldest)
{
  ConsistencyWindow columns;
  const vpImage<unsigned char> image(240, 320, 90);
  Viewpoint at;
  at.wMc = SmootherOptions::forwardCamera();
  for (int i = 0; i < 60; ++i) {
    at.wMc.t.x() = 0.1 * i;
    EXPECT_NE(columns.add(image, 0, at, 0.05, ElevationRange()), nullptr);
    at.wMc.t.x() += 0.04;
    EXPECT_EQ(columns.add(image, 0, at, 0.05, ElevationRange()), nullptr);
  }
  EXPECT_EQ(columns.frames().size(), 24u);
}

/// The drone goes from the evenly lit side of a trunk to one where its left part lies in the sun, and the line between
/// light and shade is read as the left border.
TEST(ConsistencyWindow, TellsWithinHalfAMetreThatABorderHasBecomeALineOfLightAndShade)
{
  const test::DrawnTrunk sunny{3.55, 0.3, 0.18, 150}, shady{3.5, 0.2, 0.08, 60};
  std::vector<test::DrawnTrunk> scene = test::wall();
  scene.insert(scene.end(), {sunny, shady});
  const PinholeCamera camera;
  ConsistencyWindow columns;
  std::vector<Pose> poses;
  const auto fly = [&](int from, int to, const Trunk &reading) {
    for (int i = from; i < to; ++i) {
      Viewpoint at;
      at.camera = camera;
      at.wMc = SmootherOptions::forwardCamera();
      at.wMc.t = {0, -0.8 + 0.06 * i, 1.2};
      columns.add(test::draw(scene, at.wMc, camera), poses.size(), at, 0.05, ElevationRange());
      poses.push_back(at.wMc);
      std::vector<ColumnView> views;
      for (const ConsistencyWindow::Frame &frame : columns.frames())
        views.emplace_back(frame.level, poses[frame.pose]);
      columns.update(7, reading, views, 14);
    }
  };
  EXPECT_FALSE(columns.borderConsistency(7));
  fly(0, 14, test::trunkOf(sunny));
  ASSERT_TRUE(columns.borderConsistency(7));
  EXPECT_FALSE(continuesBeyondBorder(*columns.borderConsistency(7)));
  EXPECT_TRUE(columns.mayRedetect(7));
  columns.noteRedetection(7);
  fly(14, 22, test::trunkOf(shady));
  ASSERT_TRUE(columns.borderConsistency(7));
  EXPECT_TRUE(continuesBeyondBorder(*columns.borderConsistency(7)));
  EXPECT_LT(columns.borderConsistency(7)->left, columns.borderConsistency(7)->right);
}

TEST(ConsistencyWindow, WaitsTwiceAsLongAfterARedetectionInVain)
{
  const test::LevelFlight flight(test::barkOf(kWhole, 0), test::sweep());
  const std::vector<ColumnView> views = flight.views();
  ConsistencyWindow columns;
  const auto viewsUntilItMay = [&] {
    int n = 0;
    for (; n < 100 && !columns.mayRedetect(7); ++n)
      columns.update(7, test::trunkOf(kWhole), views, 14);
    columns.noteRedetection(7);
    return n;
  };
  EXPECT_EQ(viewsUntilItMay(), 6);
  EXPECT_EQ(viewsUntilItMay(), 12);
  EXPECT_EQ(viewsUntilItMay(), 24);
  EXPECT_EQ(viewsUntilItMay(), 24); // all that is compared is new
  columns.forget(7);
  EXPECT_EQ(viewsUntilItMay(), 6);
}
} // namespace
