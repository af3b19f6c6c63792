// SPDX-License-Identifier: GPL-2.0-or-later
// The paper's detector, which has one frame only, on drawn borders.
#include "drawn_trunks.h"

#include "detection/line_detector.h"

#include <gtest/gtest.h>

namespace
{
using namespace bole;
using namespace bole::test;

const PinholeCamera kCamera;
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

TEST(LineDetector, FindsSalientTrunksInOneFrame)
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
}

TEST(LineDetector, FindsNothingOnTheBackground)
{
  EXPECT_TRUE(Scene().detect(vpImage<float>(240, 320, 0.95f)).empty());
}

TEST(LineDetector, FindsNothingWithoutBorders)
{
  Scene scene;
  const vpImage<float> p = salient(kTrunks, scene.wMc);
  scene.trunks.clear();
  EXPECT_TRUE(scene.detect(p).empty());
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

TEST(LineDetector, WithoutSaliencyItTakesEveryUprightPair)
{
  const Scene scene;
  const Gradient gradient = computeGradient(draw(scene.trunks, scene.wMc, kCamera), {1});
  const auto found = detectLines(gradient, nullptr, kCamera, scene.wMc.R, {}, {}, scene.options);
  EXPECT_EQ(found.size(), kTrunks.size());
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

TEST(LineDetector, HoldsToTheWidthsItIsGiven)
{
  Scene scene;
  scene.trunks = {{3, 0.8, 0.15, 40}}; // 20 px wide
  scene.options.width_max_px = 15;
  EXPECT_TRUE(scene.detect().empty());
  scene.options.width_max_px = 90;
  scene.options.width_min_px = 25;
  EXPECT_TRUE(scene.detect().empty());
}
} // namespace
