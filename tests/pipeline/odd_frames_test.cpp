// SPDX-License-Identifier: GPL-2.0-or-later
// Cameras that a pipeline may not have, and the smallest that it may.
#include "support/drawn_trunks.h"
#include "support/test.h"

#include <bole/open_source.h>
#include <bole/pipeline.h>
#include <bole/smoother.h>

using namespace bole;

namespace
{
const PinholeCamera kCamera;
const Pose kMount = SmootherOptions::forwardCamera();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
TEST(OddFrames, ACameraThatCannotBeIsRefused)
{
  PinholeCamera none = kCamera, narrow = kCamera;
  none.fx = 0;
  narrow.fx = kNaN;
  EXPECT_THROW(Pipeline(none, kMount), vpException);
  EXPECT_THROW(Pipeline(narrow, kMount), vpException);
  EXPECT_THROW(Pipeline(kCamera, Pose()), vpException) << "a camera has its own axes";
}

// Pictures of a few pixels: refused, or taken by every stage. Worth most under a sanitizer or valgrind.

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
