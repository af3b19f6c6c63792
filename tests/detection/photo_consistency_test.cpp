// SPDX-License-Identifier: GPL-2.0-or-later
// What the columns of a flight say of a trunk, on drawn ones before a striped wall.
#include "drawn_trunks.h"
#include "support/test.h"

#include "detection/border_continuity.h"
#include "detection/photo_consistency.h"

namespace
{
using namespace bole;
using namespace bole::test;

const PinholeCamera kCamera;
constexpr double kFarthest = 14;

/// How many a column shows.
int bandsOf(const LevelColumn &column)
{
  int bands = 0;
  for (std::size_t b = 0; b < kLevelBands; ++b)
    bands += !std::isnan(column.value[b]) && !std::isnan(column.slope[b]);
  return bands;
}

TEST(ColumnImage, ColumnsLeanAsTheTrunkDoes)
{
  const DrawnTrunk trunk{4, 0.1, 0.08, 40, 0.12};
  const Pose wMc = lookingAhead(0, 0);
  const ColumnImage level = computeColumnImage(draw({trunk}, wMc, kCamera), kCamera, wMc.R, ElevationRange());
  const auto at = locate(trunkOf(trunk), ColumnView(level, wMc), kFarthest);
  ASSERT_TRUE(at.has_value());
  const LevelColumn upright = level.at(std::tan(at->bearing)), leaning = level.at(std::tan(at->bearing), trunk.lean);
  ASSERT_EQ(bandsOf(leaning), kLevelBands);
  for (std::size_t b = 0; b < kLevelBands; ++b)
    EXPECT_NEAR(leaning.value[b], 40 / 255.0, 0.01) << b;
  EXPECT_GT(upright.value[kLevelBands - 1], 150 / 255.0); // beside it
}

TEST(ColumnImage, ShowsNothingOutsideTheImage)
{
  const Pose wMc = lookingAhead(0, 0);
  const ColumnImage level = computeColumnImage(draw({}, wMc, kCamera), kCamera, wMc.R, ElevationRange());
  EXPECT_EQ(bandsOf(level.at(level.q_first - 0.1)), 0);
  EXPECT_EQ(bandsOf(level.at(level.qLast() + 0.1)), 0);
  EXPECT_EQ(bandsOf(level.at(std::numeric_limits<double>::quiet_NaN())), 0);
}

TEST(PhotoConsistency, ATrunkAgreesAtItsOwnRangeOnly)
{
  const std::vector<DrawnTrunk> trunks = {{3.5, 0.5, 0.15, 40}, {5, -1, 0.2, 120}};
  const LevelFlight flight(trunks, sweep());
  for (const DrawnTrunk &trunk : trunks) {
    const auto evidence = photoConsistency(trunkOf(trunk), flight.views(), kFarthest);
    ASSERT_TRUE(evidence.has_value());
    EXPECT_LT(evidence->own, 0.4);
    EXPECT_GT(evidence->nearer, 0.5);
    EXPECT_GT(evidence->background, 0.5);
    EXPECT_TRUE(evidence->is_best_at_own);
    EXPECT_GT(evidence->left, -0.2);
    EXPECT_GT(evidence->right, -0.2);
  }
}

TEST(PhotoConsistency, ALeaningTrunkAgreesWhereItsLeanIsKnown)
{
  const DrawnTrunk leaning{3.5, 0.3, 0.1, 40, 0.12};
  const LevelFlight flight({leaning}, sweep());
  Trunk upright = trunkOf(leaning); // through the same place at the height of the camera
  upright.xy += 1.2 * upright.lean;
  upright.lean.setZero();
  const auto known = photoConsistency(trunkOf(leaning), flight.views(), kFarthest);
  const auto unknown = photoConsistency(upright, flight.views(), kFarthest);
  ASSERT_TRUE(known && unknown);
  EXPECT_LT(known->own, 0.5);
  EXPECT_LT(known->own, 0.5 * unknown->own);
  EXPECT_GT(known->background, unknown->background);
}

TEST(PhotoConsistency, AHypothesisAtAnotherRangeDisagreesThere)
{
  const DrawnTrunk trunk{3.5, 0.4, 0.15, 40};
  const LevelFlight flight({trunk}, sweep());
  const double own = photoConsistency(trunkOf(trunk), flight.views(), kFarthest)->own;
  for (const double scale : {0.75, 1.4}) { // on the line of sight of the middle of the flight
    const DrawnTrunk wrong{0.14 + scale * (trunk.x - 0.14), scale * trunk.y, scale * trunk.radius, 40};
    const auto evidence = photoConsistency(trunkOf(wrong), flight.views(), kFarthest);
    ASSERT_TRUE(evidence.has_value()) << scale;
    EXPECT_GT(evidence->own, own + 0.5) << scale;
    EXPECT_FALSE(evidence->is_best_at_own) << scale;
  }
}

TEST(PhotoConsistency, AGapBetweenTwoTrunksShowsWhatStandsBehind)
{
  const DrawnTrunk left{3.5, 0.6, 0.15, 40}, right{3.5, 0, 0.15, 40}, gap{3.5, 0.3, 0.15, 0};
  const LevelFlight flight({left, right}, sweep());
  const auto none = photoConsistency(trunkOf(gap), flight.views(), kFarthest);
  const auto trunk = photoConsistency(trunkOf(left), flight.views(), kFarthest);
  ASSERT_TRUE(none && trunk);
  EXPECT_GT(none->own, 1);
  EXPECT_LT(none->background, trunk->background - 0.3);
}

/// The right part of the trunk lies in shadow: its reading is as wide as the lit part.
TEST(PhotoConsistency, BesideAnEdgeOfShadowTheTrunkGoesOn)
{
  const DrawnTrunk lit{3.5, 0.4, 0.08, 150}, shadow{3.55, 0.3, 0.18, 60};
  const LevelFlight flight({lit, shadow}, sweep());
  const auto evidence = photoConsistency(trunkOf(lit), flight.views(), kFarthest);
  ASSERT_TRUE(evidence.has_value());
  EXPECT_LT(evidence->right, evidence->left - 0.2);
  EXPECT_LT(evidence->right, -0.25);
}

TEST(PhotoConsistency, BesideATrunkTheBackgroundAgreesAndBesideAStripOfAFacadeTheFacade)
{
  const DrawnTrunk one{4, 0.4, 0.15, 40};
  const LevelFlight before_a_wall({one}, sweep()), in_a_facade(facadeAround(one), sweep());
  EXPECT_GT(freeBeside(trunkOf(one), before_a_wall.views(), kFarthest), 0.3);
  EXPECT_LT(freeBeside(trunkOf(one), in_a_facade.views(), kFarthest), -0.3);
  const LevelFlight resting({one}, std::vector<Pose>(18, lookingAhead(0, 0)));
  EXPECT_EQ(freeBeside(trunkOf(one), resting.views(), kFarthest), 0);
}

TEST(PhotoConsistency, ViewByViewItIsTheSame)
{
  const DrawnTrunk trunk{3.5, 0.4, 0.15, 40};
  const LevelFlight flight({trunk}, sweep());
  const std::vector<ColumnView> views = flight.views();
  const auto at_once = photoConsistency(trunkOf(trunk), views, kFarthest);
  ConsistencyCurves all, faded;
  EXPECT_FALSE(consistencyOf(all).has_value());
  for (std::size_t i = 0; i < views.size(); ++i)
    if (const auto view = consistencyOfView(trunkOf(trunk), i, views, kFarthest)) {
      all.add(*view);
      faded.fade(0.5);
      faded.add(*view);
    }
  const auto by_view = consistencyOf(all), lately = consistencyOf(faded);
  ASSERT_TRUE(at_once && by_view && lately);
  EXPECT_EQ(by_view->views, at_once->views);
  EXPECT_NEAR(by_view->own, at_once->own, 1e-9);
  EXPECT_NEAR(by_view->left, at_once->left, 1e-9);
  const auto last = consistencyOfView(trunkOf(trunk), views.size() - 1, views, kFarthest);
  ASSERT_TRUE(last.has_value());
  EXPECT_LT(std::abs(lately->own - last->mean(0, 4)), std::abs(by_view->own - last->mean(0, 4)) + 1e-9);
}

/// Of a trunk that is read as it is depth says no more than a pixel; where only its lit part is read, it ends the trunk
/// where the shadow does.
TEST(DepthBorders, AreThoseOfTheSilhouetteWhateverTheLight)
{
  const DrawnTrunk whole{3.55, 0.3, 0.18, 60}, lit{3.42, 0.39, 0.09, 0};
  const LevelFlight flight(barkOf(whole, 0), sweep());
  const auto right = depthBorders(trunkOf(whole), flight.views(), kFarthest);
  ASSERT_TRUE(right && right->least[0] && right->least[1]);
  for (const std::size_t side : {0, 1}) {
    EXPECT_LT(*right->least[side], 0.18 + 1.25 * right->px) << side;
    EXPECT_NEAR(*right->likely[side], 0.18, 1.5 * right->px) << side;
  }
  const auto narrow = depthBorders(trunkOf(lit), flight.views(), kFarthest);
  ASSERT_TRUE(narrow && narrow->least[0] && narrow->least[1]);
  EXPECT_LT(*narrow->least[0], 0.09 + 1.25 * narrow->px);
  EXPECT_GT(*narrow->least[1], 0.09 + 2 * narrow->px);
  EXPECT_NEAR(*narrow->likely[1], 0.27, 1.5 * narrow->px);
}

/// A line on the bark of a thick trunk, near its left border: the other border is ten times as far off as the line.
TEST(DepthBorders, AreLookedForAsFarAsTheThickestTrunkGoes)
{
  const DrawnTrunk whole{3.7, 0.1, 0.3, 60}, strip{3.46, 0.3, 0.05, 0};
  const LevelFlight flight(barkOf(whole, 0), sweep());
  const auto near = depthBorders(trunkOf(strip), flight.views(), kFarthest);
  EXPECT_FALSE(near && near->likely[1]);
  const auto far = depthBorders(trunkOf(strip), flight.views(), kFarthest, 0.6);
  ASSERT_TRUE(far && far->likely[0] && far->likely[1]);
  EXPECT_NEAR(*far->likely[0] + *far->likely[1], 2 * whole.radius, 0.1);
}

TEST(PhotoConsistency, WithoutParallaxOrWhereNothingIsThereIsNone)
{
  const DrawnTrunk trunk{3.5, 0.4, 0.15, 40};
  const LevelFlight flight({trunk}, sweep()), still({trunk}, std::vector<Pose>(18, lookingAhead(0, 0)));
  EXPECT_FALSE(depthBorders(trunkOf({3.5, -0.4, 0.15, 40}), flight.views(), kFarthest).has_value());
  EXPECT_FALSE(depthBorders(trunkOf(trunk), still.views(), kFarthest).has_value());
  const std::vector<ColumnView> all = flight.views();
  EXPECT_FALSE(depthBorders(trunkOf(trunk), {all.begin(), all.begin() + 5}, kFarthest).has_value());
  EXPECT_FALSE(photoConsistency(trunkOf(trunk), still.views(), kFarthest).has_value());
  EXPECT_FALSE(photoConsistency(trunkOf({-4, 0, 0.15, 40}), flight.views(), kFarthest).has_value()); // behind
}

/// Brightness that changes from row to row at random: alike over the whole width, or another left of column 60.
vpImage<unsigned char> rows(bool is_one_surface)
{
  std::mt19937 random(7);
  std::uniform_int_distribution<int> brightness(40, 200);
  vpImage<unsigned char> image(100, 120);
  for (unsigned v = 0; v < image.getHeight(); ++v) {
    const int left = brightness(random), right = brightness(random);
    for (unsigned u = 0; u < image.getWidth(); ++u)
      image[v][u] = static_cast<unsigned char>(u < 60 && !is_one_surface ? left : right);
  }
  return image;
}

TEST(BorderContinuity, RowsOfAWallGoOnAcrossABorderAndThoseOfATrunkDoNot)
{
  const BorderLine line{60, 0, 10, 90};
  for (const Border border : kBorders) {
    const auto wall = continuityAcross(rows(true), line, border, 6),
               trunk = continuityAcross(rows(false), line, border, 6);
    ASSERT_TRUE(wall && trunk);
    EXPECT_GT(*wall, 0.99);
    EXPECT_LT(std::abs(*trunk), 0.3); // three sigma of 76 rows that are smoothed by three
  }
}

TEST(BorderContinuity, NothingIsSaidOfAShortBorderNorOfOneBesideTheImage)
{
  const vpImage<unsigned char> wall = rows(true), grey(100, 120, 128);
  EXPECT_FALSE(continuityAcross(wall, {60, 0, 10, 45}, Border::left, 6));
  EXPECT_FALSE(continuityAcross(wall, {5, 0, 10, 90}, Border::left, 6));
  EXPECT_FALSE(continuityAcross(wall, {60, 0.9, 10, 90}, Border::right, 6));
  EXPECT_EQ(continuityAcross(grey, {60, 0, 10, 90}, Border::left, 6), 0.0); // without texture
}
} // namespace
