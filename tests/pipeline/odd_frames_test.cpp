// SPDX-License-Identifier: GPL-2.0-or-later
// Frames that a pipeline may not take: they leave no trace.
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
constexpr int kFrames = 14, kMiddle = 7;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

Frame swaying(int k)
{
  Frame frame;
  frame.stamp_ns = 1'000'000'000 + k * 100'000'000LL;
  frame.wMb_odometry = Pose(Eigen::Matrix3d::Identity(), {0, 0.8 * std::sin(0.15 * k), 1.2});
  for (int i = 1; i <= 5; ++i)
    frame.gyro.push_back({frame.stamp_ns + (i - 5) * 20'000'000LL, {0, 0, 0}, Eigen::Vector3d(0, 0, 9.81)});
  frame.image = test::drawTrunks(kCamera, (*frame.wMb_odometry * kMount).inverse(), test::smallWood(), unsigned(k));
  return frame;
}

/// The frame \p k spoilt in every way.
std::vector<Frame> oddFrames(int k)
{
  std::vector<Frame> odd(7, swaying(k));
  odd[0].wMb_odometry->t.x() = kNaN;
  odd[1].wMb_odometry->R *= 3;
  odd[2].gyro[2].rate.y() = kNaN;
  odd[3].gyro[4].force->z() = kNaN;
  std::swap(odd[4].gyro[0], odd[4].gyro[3]);
  odd[5].stamp_ns = std::numeric_limits<std::int64_t>::max();
  odd[6].stamp_ns = std::numeric_limits<std::int64_t>::min();
  if (k > 0) { // a stamp as before, and one from long ago
    odd.insert(odd.end(), 2, swaying(k));
    odd[7].stamp_ns = swaying(k - 1).stamp_ns;
    odd[8].stamp_ns -= 5'000'000'000;
  }
  return odd;
}

void offerOddFrames(Pipeline &pipeline, int k)
{
  for (const Frame &odd : oddFrames(k))
    EXPECT_THROW(pipeline.process(odd), vpException) << k;
}

/// Everything that is known after a flight, as numbers.
std::vector<double> flown(bool offers_odd_frames)
{
  Pipeline pipeline(kCamera, kMount);
  std::vector<double> all;
  const auto add = [&all](const Pose &pose) {
    all.insert(all.end(), pose.R.data(), pose.R.data() + 9);
    all.insert(all.end(), pose.t.data(), pose.t.data() + 3);
  };
  for (int k = 0; k < kFrames; ++k) {
    if (offers_odd_frames && (k == 0 || k == kMiddle || k == kFrames - 1))
      offerOddFrames(pipeline, k);
    const FrameReport report = pipeline.process(swaying(k));
    EXPECT_EQ(report.index, static_cast<std::size_t>(k));
    EXPECT_EQ(report.frame_status, FrameStatus::ok);
    add(report.wMb);
  }
  if (offers_odd_frames)
    offerOddFrames(pipeline, kFrames);
  pipeline.finish();
  for (const StampedPose &pose : pipeline.smoothedTrajectory())
    add(pose.wMb);
  for (const TrunkRecord &trunk : pipeline.map())
    all.insert(all.end(), {trunk.xy.x(), trunk.xy.y(), trunk.radius, trunk.probability, double(trunk.observations)});
  return all;
}

TEST(OddFrames, LeaveThePipelineAsItWas) { EXPECT_EQ(flown(true), flown(false)); }

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
