// SPDX-License-Identifier: GPL-2.0-or-later
// What moves the pipeline when the pose filter, the points or both are missing.
#include "motion/rendered_walls.h"
#include "support/test.h"

#include "geometry/so3.h"
#include "pipeline/engine.h"

using namespace bole;

namespace
{
const PinholeCamera kCamera;
const Pose kMount = SmootherOptions::forwardCamera();

/// The frame that a camera at wMc (camera axes) would bring.
Frame frameAt(int k, const Pose &wMc)
{
  Frame frame;
  frame.stamp_ns = k * 100000000LL;
  frame.image = test::drawWalls(kCamera, wMc);
  return frame;
}

/// Body poses over a ground at z = 0, from poses in camera axes.
Pose bodyAt(const Pose &wMc)
{
  return Pose(Eigen::Matrix3d::Identity(), {0, 0, 1.5}) * kMount * wMc * kMount.inverse();
}

Pose sideways(int k) { return {expSo3({0, 0.01 * std::sin(0.4 * k), 0}), {0.1 * k, 0, 0.04 * k}}; }

/// And no step stays loose once the unit is known.
TEST(PlainVideo, StepsAreThoseOfThePointsUpToOneScale)
{
  constexpr std::size_t kFrames = 24;
  Pipeline pipeline(kCamera, kMount);
  for (int k = 0; k < int(kFrames); ++k)
    pipeline.process(frameAt(k, sideways(k)));
  const auto path = pipeline.smoothedTrajectory();
  ASSERT_EQ(path.size(), 24u);
  const auto cameraAt = [&](std::size_t k) { return kMount.inverse() * path[0].wMb.inverse() * path[k].wMb * kMount; };
  const double unit = sideways(23).t.norm() / cameraAt(23).t.norm();
  for (std::size_t k = 0; k < path.size(); ++k) {
    const Pose truth = sideways(0).inverse() * sideways(static_cast<int>(k));
    EXPECT_LT((unit * cameraAt(k).t - truth.t).norm(), 0.02 * sideways(23).t.norm()) << k;
    EXPECT_LT(logSo3(cameraAt(k).R.transpose() * truth.R).norm(), 0.01) << k;
  }
  EXPECT_EQ(pipeline.reference().scale, ScaleSource::prior);
  EXPECT_GT(pipeline.reference().scale_sigma, 0.1);
  EXPECT_TRUE(pipeline.reference().has_ranges);
  std::array<double, kFrames> loosest{}; // of the steps over each frame, the tightest edge's sigma [m]
  loosest.fill(1e3);
  for (const auto &edge : pipeline.graph().odometry) {
    const double sigma = std::sqrt(edge.odometry.covariance.topLeftCorner<3, 3>().trace() / 3);
    for (std::size_t k = edge.a + 1; k <= edge.b; ++k)
      loosest[k] = std::min(loosest[k], sigma);
  }
  for (std::size_t k = 1; k < kFrames; ++k)
    EXPECT_LT(loosest[k], 0.1) << "step to frame " << k;
}

TEST(PlainVideo, ACameraThatOnlyTurnsHasNoRangesAndSaysSo)
{
  Pipeline pipeline(kCamera, kMount);
  FrameReport last;
  for (int k = 0; k < 20; ++k)
    last = pipeline.process(frameAt(k, {expSo3({0, 0.01 * k, 0}), {0, 0, 0}}));
  const Pose turned = pipeline.smoothedTrajectory().front().wMb.inverse() * last.wMb;
  EXPECT_NEAR(logSo3(turned.R).norm(), 0.19, 0.01);
  EXPECT_LT(turned.t.norm(), 0.011);
  EXPECT_FALSE(pipeline.reference().has_ranges);
  EXPECT_NE(describe(pipeline.reference()).find("no ranges"), std::string::npos);
  for (const TrunkRecord &trunk : pipeline.map()) { // what stands upright is held by its bearing: its range is a guess
    const Eigen::Vector2d along = trunk.xy.normalized();
    EXPECT_GT(std::sqrt(along.dot(trunk.covarianceXy() * along)), 0.25 * trunk.xy.norm()) << trunk.id;
  }
}

TEST(PlainVideo, FrozenFramesStandStill)
{
  Pipeline pipeline(kCamera, kMount);
  Pose before;
  for (int k = 0; k < 12; ++k)
    before = pipeline.process(frameAt(k, sideways(k))).wMb;
  for (int k = 12; k < 22; ++k) {
    const Pose now = pipeline.process(frameAt(k, sideways(11))).wMb;
    EXPECT_LT(now.minus(before).head<3>().norm(), 0.02) << k;
    before = now;
  }
}

TEST(WithOdometry, AWhiteWallFallsBackToThePoseFilterWithinTheFrame)
{
  Pipeline pipeline(kCamera, kMount);
  Pose filter_before;
  for (int k = 0; k < 20; ++k) {
    Frame frame = frameAt(k, sideways(k));
    frame.wMb_odometry = bodyAt(sideways(k));
    if (k >= 12)
      frame.image = vpImage<unsigned char>(240, 320, 250);
    const FrameReport report = pipeline.process(frame);
    if (k >= 12) {
      const auto path = pipeline.smoothedTrajectory(); // what was learnt of the frame before is no part of the step
      const Pose step = path[path.size() - 2].wMb.inverse() * path.back().wMb;
      const Pose filter = filter_before.inverse() * *frame.wMb_odometry;
      EXPECT_LT(step.minus(filter).head<3>().norm(), 2e-3) << k;
      EXPECT_LT(step.minus(filter).tail<3>().norm(), 2e-3) << k;
      EXPECT_TRUE(report.is_translation_seen) << k;
    }
    filter_before = *frame.wMb_odometry;
  }
}
TEST(ScenePoints, LieOnTheWallsAsFarAsAsked)
{
  Pipeline pipeline(kCamera, kMount);
  FrameReport report;
  for (int k = 0; k < 12; ++k) {
    Frame frame = frameAt(k, sideways(k));
    frame.wMb_odometry = bodyAt(sideways(k));
    report = pipeline.process(frame);
    EXPECT_TRUE(k > 1 || placedPoints(report, 20).empty()); // of no age, without parallax
  }
  const auto all = placedPoints(report, 10), near = placedPoints(report, 6);
  EXPECT_GT(all.size(), 20u);
  EXPECT_GT(near.size(), 5u);
  EXPECT_LT(near.size(), all.size());
  const auto on_a_wall = std::count_if(all.begin(), all.end(), [](const Eigen::Vector3d &point) {
    return std::min(std::abs(point.x() - 5), std::abs(point.x() - 8)) < 0.3;
  });
  EXPECT_GE(20 * on_a_wall, 19 * static_cast<long>(all.size())); // corners where one wall ends before another slide
}

/// Dark slabs at z = 4 before a bright wall at z = 9, seen from wMc: a post 0.6 m wide about x = 1.1, and a slot of
/// 0.4 m about x = -0.7.
vpImage<unsigned char> drawSlabs(const Pose &wMc)
{
  vpImage<unsigned char> image(static_cast<unsigned>(kCamera.height), static_cast<unsigned>(kCamera.width));
  const auto isSlab = [](double x) { return (x > -4 && x < -0.9) || (x > -0.5 && x < 0.1) || (x > 0.8 && x < 1.4); };
  for (unsigned y = 0; y < image.getHeight(); ++y)
    for (unsigned x = 0; x < image.getWidth(); ++x) {
      const Eigen::Vector3d ray = wMc.R * kCamera.ray({double(x), double(y)});
      const Eigen::Vector3d near = wMc.t + (4 - wMc.t.z()) / ray.z() * ray,
                            far = wMc.t + (9 - wMc.t.z()) / ray.z() * ray;
      image[y][x] = isSlab(near.x())
                        ? static_cast<unsigned char>(10 + 60 * test::texture(near.x() / 0.12, near.y() / 0.12, 4))
                        : static_cast<unsigned char>(120 + 120 * test::texture(far.x() / 0.25, far.y() / 0.25, 9));
    }
  return image;
}

TEST(LookThrough, ASlotBetweenTwoWallsIsSeenThroughAndAPostIsNot)
{
  Engine pipeline(kCamera, kMount, StageOptions());
  for (int k = 0; k < 30; ++k) {
    const Pose wMc(Eigen::Matrix3d::Identity(), {0.08 * k - 1.2, 0, 0});
    Frame frame = frameAt(k, wMc);
    frame.image = drawSlabs(wMc);
    frame.wMb_odometry = bodyAt(wMc);
    pipeline.process(frame);
  }
  const auto standsAt = [&](double x) -> const MapTrunk * { // the longest seen, also one that was given up since
    const MapTrunk *longest = nullptr;
    for (const MapTrunk &trunk : pipeline.trunks().trunks())
      if ((trunk.trunk.xy - Eigen::Vector2d(4, -x)).norm() < 0.15 &&
          (!longest || trunk.observations > longest->observations))
        longest = &trunk;
    return longest;
  };
  const MapTrunk *slot = standsAt(-0.7), *post = standsAt(1.1);
  ASSERT_TRUE(slot && post); // two borders with parallax are all that a trunk is asked for at first
  EXPECT_FALSE(post->removed);
  EXPECT_GT(slot->seeThroughRatio(), 2);
  EXPECT_TRUE(slot->isGap());
  EXPECT_GT(post->points.on, 0);
  EXPECT_EQ(post->seeThroughRatio(), 0);
  EXPECT_GT(post->pointsBeside(), 1);
}
} // namespace
