// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/consistency_window.h"

#include "detection/drawn_trunks.h"
#include "pipeline/final_pass.h"

#include <gmock/gmock.h>

namespace
{
using namespace bole;

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
  const test::DrawnTrunk trunk{3.55, 0.3, 0.18, 60};
  const test::LevelFlight flight(test::barkOf(trunk, 0), test::sweep());
  const std::vector<ColumnView> views = flight.views();
  ConsistencyWindow columns;
  const auto viewsUntilItMay = [&] {
    int n = 0;
    for (; n < 100 && !columns.mayRedetect(7); ++n)
      columns.update(7, test::trunkOf(trunk), views, 14);
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
