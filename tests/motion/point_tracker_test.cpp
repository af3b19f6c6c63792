// SPDX-License-Identifier: GPL-2.0-or-later
#include "rendered_walls.h"
#include "support/test.h"

#include "geometry/so3.h"
#include "motion/lucas_kanade.h"
#include "motion/point_motion.h"
#include "motion/window_loops.h"
#include <bole/open_source.h>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

namespace
{
using namespace bole;
using namespace bole::test;

const PinholeCamera kCamera;

Pose poseAt(int k) { return {expSo3({0, 0.004 * k, 0}), {0.08 * k, 0.01 * k, 0.05 * k}}; }

TEST(PointTracker, FollowsCornersToTheirPlaceInTheNextFrames)
{
  PointTracker tracker(kCamera);
  for (int k = 0; k < 4; ++k)
    tracker.track(drawWalls(kCamera, poseAt(k)));
  const auto matches = tracker.matches(3);
  ASSERT_GT(matches.size(), 60u);
  // Every wall is at a known depth: one of them explains the match to a fraction of a pixel.
  int right = 0;
  for (const PointMatch &match : matches) {
    double best = 1e9;
    for (const double z : {5.0, 8.0, 14.0}) {
      const Eigen::Vector3d point = poseAt(0).R * kCamera.ray(match.a_px);
      const Eigen::Vector3d world = poseAt(0).t + point * ((z - poseAt(0).t.z()) / point.z());
      best = std::min(best, (kCamera.project(poseAt(3).inverse() * world) - match.b_px).norm());
    }
    right += best < 0.3;
  }
  EXPECT_GT(right, 0.85 * double(matches.size()));
}

TEST(PointTracker, FollowsCornersThroughExposuresThatHuntAndMeasuresThem)
{
  constexpr std::size_t kFrames = 6;
  const auto followed = [](double darkest) {
    PointTracker tracker(kCamera);
    for (std::size_t k = 0; k < kFrames; ++k) {
      vpImage<unsigned char> image = drawWalls(kCamera, poseAt(static_cast<int>(k)));
      for (unsigned i = 0; i < image.getSize(); ++i)
        image.bitmap[i] = static_cast<unsigned char>(std::lround((k % 2 == 0 ? 1 : darkest) * image.bitmap[i]));
      tracker.track(image);
      EXPECT_NEAR(tracker.brightnessChange(), k == 0 ? 0 : k % 2 == 0 ? -std::log(darkest) : std::log(darkest), 0.01);
    }
    return tracker.matches(kFrames - 1).size();
  };
  EXPECT_GT(followed(0.5), 0.9 * static_cast<double>(followed(1)));
}

TEST(PointTracker, SpreadsItsPointsAndNeverUsesAnIdTwice)
{
  PointTracker tracker(kCamera);
  std::set<std::uint64_t> alive, dead;
  for (int k = 0; k < 6; ++k) {
    tracker.track(drawWalls(kCamera, poseAt(3 * k)));
    std::set<std::uint64_t> now;
    for (const PointTrack &track : tracker.tracks()) {
      EXPECT_TRUE(now.insert(track.id).second);
      EXPECT_EQ(dead.count(track.id), 0u);
    }
    for (std::uint64_t id : alive) {
      if (now.count(id) == 0)
        dead.insert(id);
    }
    alive = now;
  }
  std::set<int> cells;
  for (const PointTrack &track : tracker.tracks())
    cells.insert(int(track.current().x() / 80) + 10 * int(track.current().y() / 80));
  EXPECT_EQ(cells.size(), 12u); // every cell of 4 x 3
}

TEST(PointTracker, AWhiteWallHasNoPointsAndAnImageOfAnotherSizeIsAUsersMistake)
{
  PointTracker tracker(kCamera);
  vpImage<unsigned char> white(240, 320, 250);
  tracker.track(white);
  tracker.track(white);
  EXPECT_TRUE(tracker.tracks().empty());
  EXPECT_TRUE(tracker.matches(1).empty());
  EXPECT_THROW(tracker.track(vpImage<unsigned char>(100, 100, 0)), vpException);
}

/// A jagged rope in front of a plain wall, and spots beside it; everything moved by (x, y).
vpImage<unsigned char> rope(double x, double y)
{
  vpImage<unsigned char> image(240, 320, 60);
  for (int v = 0; v < 240; ++v)
    for (int u = 0; u < 320; ++u) {
      const double wall_u = u - x, wall_v = v - y;
      if (std::abs(wall_v - 0.6 * wall_u - 60) < 1.5) // the middle of the pixel alone is asked: steps, as in a render
        image[v][u] = 190;
      for (int spot = 0; spot < 60; ++spot) {
        const double su = wall_u - 40 - (spot % 15) * 19.3 - 3 * (spot % 4),
                     sv = wall_v - 20 - (spot % 3) * 5 - (spot / 15) * 9.1 + (spot / 30) * -162;
        image[v][u] = static_cast<unsigned char>(std::min(255., image[v][u] + 90 * std::exp(-(su * su + sv * sv) / 8)));
      }
    }
  return image;
}

TEST(PointTracker, NoPointSlidesAlongARope)
{
  PointTracker tracker(kCamera);
  for (int k = 0; k < 4; ++k)
    tracker.track(rope(1.3 * k, 0.4 * k));
  const auto matches = tracker.matches(3);
  EXPECT_GT(matches.size(), 30u);
  for (const PointMatch &match : matches)
    EXPECT_LT((match.b_px - match.a_px - Eigen::Vector2d(3.9, 1.2)).norm(), 0.3) << match.a_px.transpose();
}

TEST(PointTracker, FollowsATurnOfAQuarterOfThePicture)
{
  PointTracker tracker(kCamera);
  const Pose turned(expSo3({0.03, 0.4, 0}), {0.02, 0, 0.05}); // 85 px
  tracker.track(drawWalls(kCamera, {}));
  tracker.track(drawWalls(kCamera, turned));
  const auto matches = tracker.matches(1);
  EXPECT_GT(matches.size(), 40u);
  int right = 0;
  for (const PointMatch &match : matches)
    right += (kCamera.project(turned.R.transpose() * kCamera.ray(match.a_px)) - match.b_px).norm() < 6; // parallax
  EXPECT_GT(right, 0.9 * double(matches.size()));
}

TEST(PointTracker, AForgottenImageLeavesNoTrace)
{
  PointTracker tracker(kCamera), other(kCamera);
  for (PointTracker *each : {&tracker, &other})
    each->track(drawWalls(kCamera, poseAt(0)));
  tracker.track(drawWalls(kCamera, poseAt(9)));
  tracker.forgetLast();
  for (PointTracker *each : {&tracker, &other})
    each->track(drawWalls(kCamera, poseAt(1)));
  const auto matches = tracker.matches(1), expected = other.matches(1);
  ASSERT_GT(matches.size(), 40u);
  for (const PointMatch &match : matches) {
    const auto same =
        std::find_if(expected.begin(), expected.end(), [&](const auto &e) { return e.a_px == match.a_px; });
    ASSERT_NE(same, expected.end());
    EXPECT_EQ(match.b_px, same->b_px);
  }
}

Frame frameAt(int k, const vpImage<unsigned char> &image, const Pose &bMc)
{
  Frame frame;
  frame.index = static_cast<std::size_t>(k);
  frame.stamp_ns = k * 100000000LL;
  frame.image = image;
  frame.wMb_odometry = poseAt(k) * bMc.inverse();
  for (int i = 1; i <= 20 && k > 0; ++i) {
    const Eigen::Matrix3d b0Rb1 = bMc.R * poseAt(k - 1).R.transpose() * poseAt(k).R * bMc.R.transpose();
    frame.gyro.push_back({frame.stamp_ns - 100000000LL + i * 5000000LL, logSo3(b0Rb1) / 0.1});
  }
  return frame;
}

TEST(PointMotion, FindsTheMotionOfEveryFrame)
{
  const Pose bMc = forwardCamera();
  PointMotion motion(kCamera, bMc);
  for (int k = 0; k < 6; ++k) {
    const auto steps = motion.process(frameAt(k, drawWalls(kCamera, poseAt(k)), bMc));
    EXPECT_EQ(steps.size(), k == 0 ? 0u : k < 3 ? 1u : 2u);
    for (const RelativeMotion &step : steps) {
      const Pose aMb = poseAt(k - step.frames_back).inverse() * poseAt(k);
      EXPECT_EQ(step.estimate.status, RelativePoseStatus::ok);
      EXPECT_LT(logSo3(step.estimate.aRb.transpose() * aMb.R).norm(), 1e-3);
      EXPECT_LT(directionMinus(aMb.t.normalized(), step.estimate.direction).norm(), 0.06);
    }
  }
}

TEST(PointMotion, LearnsTheBiasOfTheGyroFromTheWidestPairsAlone)
{
  const Pose bMc = forwardCamera();
  const Eigen::Vector3d bias(0, 0, 0.01);
  PointMotion motion(kCamera, bMc);
  for (int k = 0; k < 8; ++k) {
    Frame frame = frameAt(k, drawWalls(kCamera, poseAt(k)), bMc);
    for (GyroSample &sample : frame.gyro)
      sample.rate += bias;
    motion.learn(motion.process(frame));
    EXPECT_EQ(motion.gyroBias().mean.isZero(), k < 3) << k; // the widest pair is three frames apart
  }
  EXPECT_LT((motion.gyroBias().mean - bias).norm(), 0.3 * bias.norm()) << motion.gyroBias().mean.transpose();
}

TEST(PointMotion, FallsBackToTheGyroWithinAFrameAndRecovers)
{
  const Pose bMc = forwardCamera();
  PointMotion motion(kCamera, bMc);
  const vpImage<unsigned char> white(240, 320, 250);
  for (int k = 0; k < 3; ++k)
    motion.process(frameAt(k, drawWalls(kCamera, poseAt(k)), bMc));
  const auto blind = motion.process(frameAt(3, white, bMc));
  ASSERT_FALSE(blind.empty());
  EXPECT_EQ(blind[0].estimate.status, RelativePoseStatus::too_few_points);
  const Pose aMb = poseAt(2).inverse() * poseAt(3);
  EXPECT_LT(logSo3(blind[0].estimate.aRb.transpose() * aMb.R).norm(), 1e-3);
  motion.process(frameAt(4, drawWalls(kCamera, poseAt(4)), bMc));
  const auto seeing = motion.process(frameAt(5, drawWalls(kCamera, poseAt(5)), bMc));
  EXPECT_EQ(seeing[0].estimate.status, RelativePoseStatus::ok);
}

TEST(PointMotion, PassesOverFramesThatAreNotOk)
{
  PointMotion motion(kCamera, {});
  Frame frame = frameAt(0, drawWalls(kCamera, poseAt(0)), {});
  motion.process(frame);
  Frame missing;
  missing.status = FrameStatus::missing;
  EXPECT_TRUE(motion.process(missing).empty());
  const auto steps = motion.process(frameAt(2, drawWalls(kCamera, poseAt(2)), {}));
  ASSERT_EQ(steps.size(), 1u);
  EXPECT_EQ(steps[0].a_index, 0u);
  EXPECT_EQ(steps[0].b_index, 2u);
}

TEST(PointMotion, NamesImagesWhoseRowsAreShearedAndGoesOnFromTheLastGoodOne)
{
  constexpr double kShear[] = {0, 0, 0.04, -0.03, 0};
  const auto ahead = [](int k) { return Pose(Eigen::Matrix3d::Identity(), {0.02 * k, 0.01 * k, 0.15 * k}); };
  for (const bool has_gyro : {true, false})
    for (const bool has_odometry : {true, false}) {
      PointMotion motion(kCamera, {});
      for (int k = 0; k < 5; ++k) {
        Frame frame;
        frame.stamp_ns = k * 100000000LL;
        frame.image = drawWalls(kCamera, ahead(k), kShear[k]);
        if (has_odometry)
          frame.wMb_odometry = ahead(k);
        for (int i = 1; i <= 20 && k > 0 && has_gyro; ++i)
          frame.gyro.push_back({frame.stamp_ns - 100000000LL + i * 5000000LL, Eigen::Vector3d::Zero()});
        const auto steps = motion.process(frame);
        if (!has_gyro && !has_odometry) {
          EXPECT_EQ(motion.fault(), "");
          continue;
        }
        EXPECT_EQ(motion.fault().find("sheared") == 0, kShear[k] != 0) << k << ": " << motion.fault();
        EXPECT_EQ(steps.empty(), k == 0 || kShear[k] != 0);
        if (k == 4) {
          EXPECT_EQ(steps.front().a_index, 1u);
        }
      }
    }
}

cv::Mat pictureFrom(const Pose &wMc)
{
  const vpImage<unsigned char> image = drawWalls(kCamera, wMc);
  return cv::Mat(kCamera.height, kCamera.width, CV_8U, image.bitmap).clone();
}

TEST(LucasKanade, FindsWhatOpenCvFinds)
{
  const cv::Mat first = pictureFrom({}), second = pictureFrom({expSo3({0.004, 0.01, 0.003}), {0.06, 0.01, 0.05}});
  std::vector<cv::Point2f> from, theirs;
  cv::goodFeaturesToTrack(first, from, 150, 0.01, 8);
  ASSERT_GT(from.size(), 80u);
  theirs = from;
  std::vector<unsigned char> found;
  std::vector<float> error;
  const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 10, 0.01);
  cv::calcOpticalFlowPyrLK(first, second, from, theirs, found, error, {kWindow_px, kWindow_px}, 3, stop,
                           cv::OPTFLOW_USE_INITIAL_FLOW, 1e-4);
  GreyPyramid a, b;
  buildPyramid(first, 3, a);
  buildPyramid(second, 3, b);
  int same = 0, both = 0, one = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (roundness(a.front(), from[i]) < 1.2 * kLeastRoundness)
      continue; // OpenCV follows what slides along a line
    cv::Point2f ours = from[i];
    const bool is_found = followWindow(a, b, from[i], ours, 3);
    one += is_found != (found[i] != 0);
    both += is_found && found[i];
    same += is_found && found[i] && cv::norm(ours - theirs[i]) < 1e-3;
  }
  EXPECT_GT(both, 70);
  EXPECT_GE(same, both - 1);
  EXPECT_LE(one, 1);
}

TEST(LucasKanade, HasNoAnswerWhereThereIsNoTextureOrNoImage)
{
  const cv::Mat blank(kCamera.height, kCamera.width, CV_8U, cv::Scalar(90));
  GreyPyramid a;
  buildPyramid(blank, 3, a);
  for (const cv::Point2f from :
       {cv::Point2f(100, 80), cv::Point2f(-50, 80), cv::Point2f(1e9f, 3), cv::Point2f(NAN, 3)}) {
    cv::Point2f to = from;
    EXPECT_FALSE(followWindow(a, a, from, to, 3));
  }
}

TEST(Corners, HaveTheResponseThatOpenCvGivesThem)
{
  const cv::Mat image = pictureFrom({});
  cv::Mat theirs, ours(image.size(), CV_32F);
  cv::cornerMinEigenVal(image, theirs, 5, 3);
  CornerScratch scratch;
  const float most = cornerResponse(image.ptr(), image.cols, image.rows, scratch, ours.ptr<float>());
  const cv::Rect inner(kCornerMargin, kCornerMargin, image.cols - 2 * kCornerMargin, image.rows - 2 * kCornerMargin);
  double strongest = 0;
  cv::minMaxLoc(theirs(inner), nullptr, &strongest);
  EXPECT_NEAR(most, strongest, 1e-4 * strongest);
  EXPECT_LT(cv::norm(ours(inner), theirs(inner), cv::NORM_INF), 1e-4 * strongest);
}
} // namespace
