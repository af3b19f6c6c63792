// SPDX-License-Identifier: GPL-2.0-or-later
// The detector that asks a window of frames, on drawn borders.
#include "drawn_trunks.h"
#include "support/test.h"

#include "detection/line_detector.h"

namespace
{
using namespace bole;
using namespace bole::test;

const PinholeCamera kCamera;

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

TEST(Detector, FindsNothingWithoutParallaxFarAwayInABlankImageOrInTooFewViews)
{
  const std::vector<DrawnTrunk> near = {{3, 0.7, 0.15, 40}}, far = {{20, 0.5, 0.6, 40}, {25, -2, 0.7, 40}};
  EXPECT_TRUE(detect(DrawnFlight(near, std::vector<Pose>(18, lookingAhead(0, 0)))).empty());
  EXPECT_TRUE(detect(DrawnFlight(far, sweep())).empty());
  EXPECT_TRUE(detect(DrawnFlight({}, sweep())).empty());
  EXPECT_TRUE(detect(DrawnFlight(near, sweep(4))).empty());
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

LevelProfile profileOf(const std::vector<DrawnTrunk> &trunks, const Pose &wMc)
{
  return computeLevelProfile(computeGradient(draw(trunks, wMc, kCamera)).signed_x, kCamera, wMc.R, {});
}

/// tan of the bearing from the heading of \p wMc of the left or right border of a trunk.
double borderColumn(const DrawnTrunk &trunk, const Pose &wMc, bool is_left)
{
  const Eigen::Vector2d forward = wMc.R.col(2).head<2>().normalized(), w = trunkOf(trunk).xy - wMc.t.head<2>();
  const double bearing = std::atan2(forward.x() * w.y() - forward.y() * w.x(), forward.dot(w));
  return std::tan(bearing + (is_left ? 1 : -1) * std::asin(trunk.radius / w.norm()));
}

/// The nearest peak to a column, in pixels of the camera.
double distance_px(const LevelProfile &profile, double q, double *contrast = nullptr)
{
  double nearest = 1e9;
  for (const ProfilePeak &peak : profile.peaks)
    if (std::abs(peak.q - q) < nearest) {
      nearest = std::abs(peak.q - q);
      if (contrast)
        *contrast = peak.contrast;
    }
  return nearest * kCamera.fx;
}

TEST(LevelProfile, PeaksStandAtTheBordersWhateverTheAttitude)
{
  const std::vector<DrawnTrunk> trunks = {{4, 0.6, 0.2, 40}, {6, -1.5, 0.15, 90}};
  for (const Pose &wMc :
       {lookingAhead(0, 0), lookingAhead(0.3, -0.2, 0.15, 0.1, -0.2), lookingAhead(0, 0.2, -0.1, -0.12, 0.3)}) {
    const LevelProfile profile = profileOf(trunks, wMc);
    for (const DrawnTrunk &trunk : trunks)
      for (const bool is_left : {true, false}) {
        double contrast = 0;
        EXPECT_LT(distance_px(profile, borderColumn(trunk, wMc, is_left), &contrast), 0.25);
        EXPECT_LT(is_left ? contrast : -contrast, -0.05); // bright to dark on the left, dark to bright on the right
      }
    EXPECT_EQ(profile.peaks.size(), 4u);
  }
}

// The paper's detector, which has one frame only, on drawn borders.

const std::vector<DrawnTrunk> kTrunks = {{3, 0.8, 0.15, 40}, {4.5, -1.2, 0.2, 90}};

/// p(background): 0.05 on the trunks, 0.95 beside them.
vpImage<float> salient(const std::vector<DrawnTrunk> &trunks, const Pose &wMc)
{
  std::vector<DrawnTrunk> wider = trunks; // labels reach a little beyond the borders
  for (DrawnTrunk &trunk : wider) {
    trunk.grey = 0.05 * 255;
    trunk.radius *= 1.3;
  }
  const auto drawn = draw(wider, wMc, kCamera, 0.95 * 255);
  vpImage<float> p(drawn.getRows(), drawn.getCols());
  for (unsigned i = 0; i < drawn.getSize(); ++i)
    p.bitmap[i] = static_cast<float>(drawn.bitmap[i]) / 255;
  return p;
}

struct Scene
{
  Pose wMc = lookingAhead(0.2, -0.1, 0.1, 0.05, 0.15);
  std::vector<DrawnTrunk> trunks = kTrunks;
  LineDetectorOptions options;
  std::vector<InhibitedRange> known;

  std::vector<LineDetection> detect(const vpImage<float> &p_background) const
  {
    const Gradient gradient = computeGradient(draw(trunks, wMc, kCamera), {1});
    return detectLines(gradient, &p_background, kCamera, wMc.R, known, {}, options);
  }
  std::vector<LineDetection> detect() const { return detect(salient(trunks, wMc)); }
};

const LineDetection *nearestTo(const std::vector<LineDetection> &found, const RelativeTrunk &truth)
{
  const LineDetection *nearest = nullptr;
  for (const LineDetection &line : found)
    if (!nearest || std::abs(line.relative.minus(truth)(2)) < std::abs(nearest->relative.minus(truth)(2)))
      nearest = &line;
  return nearest;
}

TEST(LineDetector, FindsSalientTrunksInOneFrameAndWithoutSaliencyEveryUprightPair)
{
  const Scene scene;
  const auto found = scene.detect();
  EXPECT_EQ(found.size(), kTrunks.size());
  for (const DrawnTrunk &trunk : kTrunks) {
    const RelativeTrunk truth = relativeTrunk(scene.wMc, Pose(), trunkOf(trunk));
    const LineDetection *line = nearestTo(found, truth);
    ASSERT_NE(line, nullptr);
    EXPECT_LT(std::abs(line->relative.minus(truth)(2)) * kCamera.fx, 0.7); // bearing [px]
    EXPECT_NEAR(line->relative.ratio(), truth.ratio(), 0.7 / kCamera.fx);
    EXPECT_GE(std::min(line->p_left, line->p_right), scene.options.threshold);
  }
  const Gradient gradient = computeGradient(draw(scene.trunks, scene.wMc, kCamera), {1});
  EXPECT_EQ(detectLines(gradient, nullptr, kCamera, scene.wMc.R, {}, {}, scene.options).size(), kTrunks.size());
}

TEST(LineDetector, FindsNothingOnTheBackgroundWithoutBordersOrOfAnotherWidth)
{
  Scene scene;
  EXPECT_TRUE(scene.detect(vpImage<float>(240, 320, 0.95f)).empty());
  const vpImage<float> p = salient(kTrunks, scene.wMc);
  scene.trunks.clear();
  EXPECT_TRUE(scene.detect(p).empty());
  scene.trunks = {{3, 0.8, 0.15, 40}}; // 20 px wide
  scene.options.width_max_px = 15;
  EXPECT_TRUE(scene.detect().empty());
  scene.options.width_max_px = 90;
  scene.options.width_min_px = 25;
  EXPECT_TRUE(scene.detect().empty());
}

TEST(LineDetector, IgnoresRegionsWithKnownTrunks)
{
  Scene scene;
  const RelativeTrunk first = relativeTrunk(scene.wMc, Pose(), trunkOf(kTrunks[0]));
  const Eigen::Matrix3d wRt = scene.wMc.R * first.cRt;
  const Eigen::Vector2d forward = scene.wMc.R.col(2).head<2>().normalized(), x = wRt.col(0).head<2>();
  const double bearing = std::atan2(forward.x() * x.y() - forward.y() * x.x(), forward.dot(x));
  const double half = std::asin(first.ratio());
  scene.known = {{std::tan(bearing - half), std::tan(bearing + half)}};
  const auto found = scene.detect();
  ASSERT_EQ(found.size(), 1u);
  EXPECT_LT(std::abs(found[0].relative.minus(relativeTrunk(scene.wMc, Pose(), trunkOf(kTrunks[1])))(2)), 0.01);
}

TEST(LineDetector, OnePolarityKnowsDarkTrunksOnly)
{
  Scene dark, bright;
  bright.trunks = {{3, 0.8, 0.15, 255}};
  dark.trunks = {{3, 0.8, 0.15, 40}};
  for (Scene *scene : {&dark, &bright}) {
    EXPECT_EQ(scene->detect().size(), 1u);
    scene->options.either_polarity = false;
  }
  EXPECT_EQ(dark.detect().size(), 1u);
  EXPECT_TRUE(bright.detect().empty());
}

TEST(LineDetector, ABorderBelongsToOneTrunk)
{
  Scene scene; // two dark trunks side by side: the bright gap between them shares a border with each
  scene.trunks = {{3, 0.35, 0.15, 40}, {3, -0.35, 0.15, 40}};
  const auto found = scene.detect(vpImage<float>(240, 320, 0.05f));
  ASSERT_EQ(found.size(), 2u);
  for (const LineDetection &line : found)
    EXPECT_NEAR(line.relative.ratio(), 0.15 / std::hypot(3, 0.35), 0.005);
}
} // namespace
