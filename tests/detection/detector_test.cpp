// SPDX-License-Identifier: GPL-2.0-or-later
// The detector that asks a window of frames, on drawn borders.
#include "drawn_trunks.h"

#include <gmock/gmock.h>

#include <visp3/core/vpException.h>

namespace
{
using namespace bole;
using namespace bole::test;

const Detection *nearestTo(const std::vector<Detection> &found, const DrawnTrunk &trunk)
{
  const Detection *nearest = nullptr;
  for (const Detection &detection : found)
    if (!nearest || (detection.trunk.xy - trunkOf(trunk).xy).norm() < (nearest->trunk.xy - trunkOf(trunk).xy).norm())
      nearest = &detection;
  return nearest;
}

std::vector<Detection> detect(const DrawnFlight &flight, const std::vector<InhibitedRange> &known = {},
                              const vpImage<float> *p_background = nullptr,
                              const DetectorOptions &options = DetectorOptions())
{
  return suppressNonMaxima(detectTrunks(flight.views(), flight.camera, known, p_background, options));
}

TEST(Detector, FindsTrunksWhereTheyStandAndAsThickAsTheyAre)
{
  const std::vector<DrawnTrunk> trunks = {{3, 0.7, 0.15, 40}, {4.5, -1.2, 0.2, 90}, {6, 2.2, 0.25, 60}};
  const DrawnFlight flight(trunks, sweep());
  const auto found = detect(flight);
  EXPECT_EQ(found.size(), trunks.size());
  for (const DrawnTrunk &trunk : trunks) {
    const Detection *detection = nearestTo(found, trunk);
    ASSERT_NE(detection, nullptr);
    EXPECT_LT((detection->trunk.xy - trunkOf(trunk).xy).norm(), 0.03 * trunk.x) << trunk.x << "," << trunk.y;
    EXPECT_NEAR(detection->trunk.radius(), trunk.radius, 0.04 * trunk.radius + 0.005);
    EXPECT_LT(detection->left_contrast, 0);
    EXPECT_GT(detection->right_contrast, 0);
    EXPECT_LT(detection->rms_px, 0.5);
    EXPECT_NEAR(detection->range, (trunkOf(trunk).xy - flight.poses.back().t.head<2>()).norm(), 0.2);
  }
}

TEST(Detector, FindsLeaningTrunksByLinesThatLeanAsMuch)
{
  const DrawnTrunk left{4, 0.4, 0.15, 40, 0.07}, right{5, -0.8, 0.2, 90, -0.05};
  for (const DrawnTrunk &trunk : {left, right}) {
    ProfileOptions options;
    options.lean = std::copysign(0.06, trunk.lean);
    const auto found = detect(DrawnFlight({left, right}, sweep(), options));
    const Detection *detection = nearestTo(found, trunk);
    ASSERT_NE(detection, nullptr);
    EXPECT_LT((detection->trunk.axisAt(1.2) - trunkOf(trunk).axisAt(1.2)).norm(), 0.03 * trunk.x);
    EXPECT_LT((detection->trunk.axisAt(2.5) - trunkOf(trunk).axisAt(2.5)).norm(), 0.03 * trunk.x + 0.02);
    EXPECT_NEAR(detection->trunk.radius(), trunk.radius, 0.05 * trunk.radius + 0.005);
  }
}

TEST(Detector, FindsABrightTrunkAndOneThatIsBrightOnOneSide)
{
  // the background is 200; something wide and dark far away begins behind the second
  const std::vector<DrawnTrunk> trunks = {{4, 0.8, 0.2, 250}, {3, -0.8, 0.3, 120}, {20, -7.5, 2, 40}};
  const auto found = detect(DrawnFlight(trunks, sweep(18, 0.5)));
  for (const std::size_t i : {0u, 1u}) {
    const Detection *detection = nearestTo(found, trunks[i]);
    ASSERT_NE(detection, nullptr);
    EXPECT_LT((detection->trunk.xy - trunkOf(trunks[i]).xy).norm(), 0.15) << i;
  }
  EXPECT_GT(nearestTo(found, trunks[0])->left_contrast, 0);
  EXPECT_LT(nearestTo(found, trunks[0])->right_contrast, 0);
  EXPECT_LT(nearestTo(found, trunks[1])->left_contrast, 0);
  EXPECT_LT(nearestTo(found, trunks[1])->right_contrast, 0);
}

TEST(Detector, OfTwoReadingsOfTheSameLinesPrefersThatOfTheRadiiThatAreExpected)
{
  // two dark posts, or a trunk that is bright between two lines of shade
  const std::vector<DrawnTrunk> posts = {{3, 0.21, 0.05, 40}, {3, -0.21, 0.05, 40}};
  const DrawnFlight flight(posts, sweep());
  const auto thinnest = [&](double usual) {
    DetectorOptions options;
    options.radii = {std::log(usual), 0.3};
    double radius = 1;
    for (const Detection &detection : detect(flight, {}, nullptr, options))
      radius = std::min(radius, detection.trunk.radius());
    return radius;
  };
  EXPECT_NEAR(thinnest(0.05), 0.05, 0.01);
  EXPECT_NEAR(thinnest(0.4), 0.26, 0.02);
}

TEST(Detector, SaysHowWellItKnowsThePlace)
{
  const DrawnTrunk trunk{5, 0.3, 0.2, 40};
  const auto few = detect(DrawnFlight({trunk}, sweep(18, 0.45))), wide = detect(DrawnFlight({trunk}, sweep(18, 0.9)));
  ASSERT_EQ(few.size(), 1u);
  ASSERT_EQ(wide.size(), 1u);
  const auto alongSight = [](const Detection &d) { return std::sqrt(d.covariance(0, 0)); };
  EXPECT_GT(alongSight(few[0]), 1.5 * alongSight(wide[0]));          // less parallax, less certain
  EXPECT_GT(alongSight(few[0]), std::sqrt(few[0].covariance(1, 1))); // range is known worse than bearing
  EXPECT_LT((wide[0].trunk.xy - trunkOf(trunk).xy).norm(),
            3 * std::sqrt(wide[0].covariance.topLeftCorner<2, 2>().trace()));
}

TEST(Detector, FindsNothingWithoutParallax)
{
  const std::vector<Pose> still(18, lookingAhead(0, 0));
  EXPECT_TRUE(detect(DrawnFlight({{3, 0.7, 0.15, 40}}, still)).empty());
}

TEST(Detector, FindsNothingOfTrunksThatAreFar)
{
  EXPECT_TRUE(detect(DrawnFlight({{20, 0.5, 0.6, 40}, {25, -2, 0.7, 40}}, sweep())).empty());
}

TEST(Detector, FindsNothingInABlankImageOrInTooFewViews)
{
  EXPECT_TRUE(detect(DrawnFlight({}, sweep())).empty());
  EXPECT_TRUE(detect(DrawnFlight({{3, 0.7, 0.15, 40}}, sweep(4))).empty());
}

TEST(Detector, IgnoresRegionsWithKnownTrunks)
{
  const std::vector<DrawnTrunk> trunks = {{3, 0.7, 0.15, 40}, {4.5, -1.2, 0.2, 90}};
  const DrawnFlight flight(trunks, sweep());
  const auto found = detect(flight);
  ASSERT_EQ(found.size(), 2u);
  const Detection *known = nearestTo(found, trunks[0]);
  const auto rest = detect(flight, {{known->q_right - 0.005, known->q_left + 0.005}});
  ASSERT_EQ(rest.size(), 1u);
  EXPECT_LT((rest[0].trunk.xy - trunkOf(trunks[1]).xy).norm(), 0.2);
}

TEST(Detector, LooksWhereSomethingIsNearAlone)
{
  const DrawnFlight flight({{3, 0.7, 0.15, 40}, {3, -0.7, 0.15, 40}}, sweep());
  vpImage<float> p_background(240, 320, 0.95f);
  EXPECT_TRUE(detect(flight, {}, &p_background).empty());
  for (unsigned v = 0; v < 240; ++v)
    std::fill_n(p_background[v], 160, 0.05f); // on the left
  const auto found = detect(flight, {}, &p_background);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_GT(found[0].trunk.xy.y(), 0);
}
} // namespace
