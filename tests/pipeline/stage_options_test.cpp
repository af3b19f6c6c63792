// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/option_table.h"
#include "pipeline/stage_options.h"

#include <gmock/gmock.h>

#include <fmt/format.h>

namespace
{
using namespace bole;

PinholeCamera cameraWith(double f)
{
  PinholeCamera camera;
  camera.fx = camera.fy = f;
  return camera;
}

/// Every field of the saliency's options.
std::vector<double> valuesOf(const SaliencyOptions &o)
{
  return {o.sigma_intensity,     o.sigma_background_px, o.sigma_foreground_px, double(o.label_window_px),
          o.background_prior,    double(o.iterations),  double(o.levels),      double(o.finest_level),
          o.sigma_rotation_pull, o.sample_correlation,  o.near_range,          o.min_range};
}

TEST(StageOptions, OfTheDefaultsAreTheStagesDefaultsForACameraOf200Px)
{
  const StageOptions made = stageOptions(Options(), cameraWith(200)), defaults;
  EXPECT_EQ(made.gradient.sigma_px, defaults.gradient.sigma_px);
  EXPECT_EQ(made.detection.inlier_px, defaults.detection.inlier_px);
  EXPECT_EQ(made.tracking.scan_max_px, defaults.tracking.scan_max_px);
  EXPECT_EQ(made.flow.view_spacing, defaults.flow.view_spacing);
  EXPECT_EQ(made.points.frames_back, defaults.points.frames_back);
  EXPECT_FALSE(made.smoothing.forgets);
  EXPECT_EQ(made.smoothing.window, 40);
  EXPECT_NEAR(made.map.confirm_odds, defaults.map.confirm_odds, 1e-3);
  EXPECT_EQ(valuesOf(made.saliency), valuesOf(defaults.saliency));
}

/// What `bole options` allows, the stages take: at both ends of every range, for every camera.
TEST(StageOptions, TakeEveryValueThatARangeAllows)
{
  for (const double f : {20.0, 200.0, 570.0, 5000.0})
    for (const bool is_high : {false, true}) {
      Options names;
      for (std::size_t i = 0; i < optionTable(names).size(); ++i) {
        Options options;
        OptionEntry entry = optionTable(options)[i];
        if (std::holds_alternative<bool *>(entry.value))
          **std::get_if<bool *>(&entry.value) ^= true;
        else
          ASSERT_TRUE(entry.assign(fmt::format("{}", is_high ? entry.high.value : entry.low.value)));
        const StageOptions made = stageOptions(options, cameraWith(f));
        EXPECT_NO_THROW(Smoother(made.smoothing)) << entry.key << " = " << entry.text() << ", f = " << f;
      }
    }
}

TEST(StageOptions, ThresholdsOnThePictureFollowTheFocalLength)
{
  const StageOptions narrow = stageOptions(Options(), cameraWith(600)),
                     usual = stageOptions(Options(), cameraWith(200));
  EXPECT_DOUBLE_EQ(narrow.lines.width_min_px, 3 * usual.lines.width_min_px);
  EXPECT_DOUBLE_EQ(narrow.tracking.scan_max_px, 2 * usual.tracking.scan_max_px);
  EXPECT_EQ(narrow.saliency.finest_level, usual.saliency.finest_level + 1); // which makes half of the three
  EXPECT_EQ(narrow.saliency.window_width_px, 5);
  EXPECT_EQ(narrow.saliency.window_height_px % 2, 1);
}

TEST(StageOptions, WhatIsCountedInFramesFollowsTheRate)
{
  Options options;
  options.camera.rate = 30;
  options.map.lag = 30;
  const StageOptions fast = stageOptions(options, cameraWith(200));
  EXPECT_THAT(fast.points.frames_back, testing::ElementsAre(3, 9));
  EXPECT_EQ(fast.points.every, 3);
  EXPECT_EQ(fast.smoothing.window, 900);
  EXPECT_TRUE(fast.smoothing.forgets);
  EXPECT_EQ(fast.saliency.max_frames_apart, 15);
  options.camera.rate = 15;
  EXPECT_THAT(stageOptions(options, cameraWith(200)).points.frames_back, testing::ElementsAre(1, 4));
  options.camera.rate = 5;
  EXPECT_THAT(stageOptions(options, cameraWith(200)).points.frames_back, testing::ElementsAre(1, 2));
}
} // namespace
