// SPDX-License-Identifier: GPL-2.0-or-later
// Pictures of a few pixels: refused, or taken by every stage. Worth most under a sanitizer or valgrind.
#include "support/drawn_trunks.h"

#include <bole/open_source.h>
#include <bole/pipeline.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <visp3/core/vpException.h>

namespace
{
using namespace bole;

/// Whether a camera of \p width x \p height is taken; then it flies.
bool flies(int width, int height)
{
  const double f = 0.6 * std::max(width, height);
  const PinholeCamera camera = {f, f, 0.5 * (width - 1), 0.5 * (height - 1), width, height};
  const Pose bMc = forwardCamera();
  std::optional<Pipeline> pipeline;
  try {
    pipeline.emplace(camera, bMc);
  }
  catch (const vpException &) {
    return false;
  }
  for (int k = 0; k < 6; ++k) {
    Frame frame;
    frame.stamp_ns = k * 100'000'000LL;
    frame.wMb_odometry = Pose(Eigen::Matrix3d::Identity(), {0, 0.2 * k, 1.2});
    frame.image = test::drawTrunks(camera, (*frame.wMb_odometry * bMc).inverse(), test::smallWood(), unsigned(k));
    EXPECT_TRUE(pipeline->process(frame).wMb.isFinite()) << width << " x " << height;
  }
  pipeline->finish();
  return true;
}

TEST(SmallPictures, AreRefusedOrTakenByEveryStage)
{
  constexpr int kTaken = 32; // and more, at the latest
  for (int n = 1; n <= 40; ++n) {
    EXPECT_EQ(flies(n, n), flies(n, 60)) << n;
    EXPECT_EQ(flies(n, n), flies(60, n)) << n;
    EXPECT_TRUE(n < kTaken || flies(n, n)) << n;
  }
  EXPECT_FALSE(flies(1, 1));
}
} // namespace
