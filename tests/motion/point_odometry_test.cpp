// SPDX-License-Identifier: GPL-2.0-or-later
#include "rendered_walls.h"
#include "support/test.h"

#include "geometry/so3.h"
#include "input/recorded_source.h"
#include "motion/ground_plane.h"
#include "motion/point_odometry.h"
#include "motion/vertical.h"
#include <opencv2/imgproc.hpp>

namespace
{
using namespace bole;
using namespace bole::test;

const PinholeCamera kCamera;

TEST(PointOdometry, KeepsItsUnitOfLengthAlongThePath)
{
  PointTracker tracker(kCamera);
  PointOdometry odometry(kCamera);
  std::vector<Pose> truth;
  for (int k = 0; k < 24; ++k) {
    truth.push_back({expSo3({0, 0.01 * std::sin(0.4 * k), 0}), {0.1 * k, 0.1 * std::sin(0.3 * k), 0.04 * k}});
    tracker.track(drawWalls(kCamera, truth.back()));
    odometry.process(tracker);
  }
  const auto path = odometry.trajectory();
  ASSERT_EQ(path.size(), truth.size());
  const double unit = truth.back().t.norm() / path.back().wMc.t.norm();
  for (std::size_t k = 0; k < path.size(); ++k) {
    EXPECT_LT((unit * path[k].wMc.t - truth[k].t).norm(), 0.05) << k; // 2 % of the path
    EXPECT_LT(logSo3(path[k].wMc.R.transpose() * truth[k].R).norm(), 0.006) << k;
  }
  int near = 0;
  for (const PointDepth &point : odometry.depths()) {
    const double depth = unit / point.inverse_depth;
    double best = 1e9;
    for (const double z : {5.0, 8.0, 14.0}) {
      const Eigen::Vector3d ray = truth.back().R * kCamera.ray(point.pixel);
      best = std::min(best, std::abs(depth * ray.z() + truth.back().t.z() - z) / z);
    }
    near += point.sigma < 0.1 * point.inverse_depth && best < 0.1;
  }
  EXPECT_GT(near, 30);
}

TEST(PointOdometry, ASwingOfTheCameraCostsItNoUnit)
{
  PointTracker tracker(kCamera);
  PointOdometry odometry(kCamera);
  const double yaw[] = {0, 0.12, 0.36, 0.6, 0.6, 0.4, 0.1, 0}; // up to 14 degrees a frame
  Pose truth;
  for (int k = 0; k < 24; ++k) {
    const double turned = k < 12 || k >= 20 ? 0 : yaw[k - 12];
    truth = {expSo3({0, turned, 0}), {0.1 * k, 0, 0.04 * k}};
    tracker.track(drawWalls(kCamera, truth));
    const auto result = odometry.process(tracker);
    EXPECT_LT(logSo3(result.wMc.R.transpose() * truth.R).norm(), 0.02) << k;
  }
  const auto path = odometry.trajectory();
  const double unit = path[11].wMc.t.norm() / 11, after = (path[23].wMc.t - path[20].wMc.t).norm() / 3;
  EXPECT_NEAR(after / unit, 1, 0.1);
}

TEST(PointOdometry, AStartThatTakesLongerThanTracksRememberPlacesAllItsFrames)
{
  constexpr int kFrames = 2 * PointTracker::kHistory + 16;
  PointTracker tracker(kCamera);
  PointOdometry odometry(kCamera);
  PointOdometryResult result;
  for (int k = 0; k < kFrames; ++k) {
    tracker.track(drawWalls(kCamera, {Eigen::Matrix3d::Identity(), {0.004 * k, 0, 0}}));
    result = odometry.process(tracker);
    if (k <= PointTracker::kHistory) {
      EXPECT_EQ(result.status, PointOdometryStatus::starting) << k;
    }
  }
  EXPECT_EQ(result.status, PointOdometryStatus::ok);
  const auto path = odometry.trajectory();
  const double whole = path.back().wMc.t.norm();
  for (std::size_t k = 0; k < path.size(); ++k)
    EXPECT_NEAR(path[k].wMc.t.norm() / whole, static_cast<double>(k) / (kFrames - 1), 0.05) << k;
}

TEST(PointOdometry, ACameraThatOnlyTurnsNeverGetsAUnitOfLength)
{
  PointTracker tracker(kCamera);
  PointOdometry odometry(kCamera);
  for (int k = 0; k < 15; ++k) {
    const Pose pose{expSo3({0, 0.01 * k, 0.002 * k}), {0, 0, 0}};
    tracker.track(drawWalls(kCamera, pose));
    const auto result = odometry.process(tracker);
    EXPECT_EQ(result.status, PointOdometryStatus::starting) << k;
    EXPECT_LT(logSo3(result.wMc.R.transpose() * pose.R).norm(), 2e-3) << k;
    EXPECT_EQ(result.wMc.t.norm(), 0) << k;
    if (k > 0) {
      EXPECT_GE(result.covariance(0, 0), 1);
    }
  }
}

TEST(PointOdometry, LosesItsPointsWithoutMakingAnythingUp)
{
  PointTracker tracker(kCamera);
  PointOdometry odometry(kCamera);
  PointOdometryResult result;
  for (int k = 0; k < 10; ++k) {
    tracker.track(drawWalls(kCamera, {Eigen::Matrix3d::Identity(), {0.1 * k, 0, 0}}));
    result = odometry.process(tracker);
  }
  EXPECT_EQ(result.status, PointOdometryStatus::ok);
  const vpImage<unsigned char> white(240, 320, 250);
  for (int k = 10; k < 25; ++k) {
    tracker.track(white);
    result = odometry.process(tracker);
    EXPECT_EQ(result.status, PointOdometryStatus::lost);
    EXPECT_TRUE(result.wMc.isFinite());
    EXPECT_GE(result.covariance(0, 0), 1);
  }
}

TEST(PointOdometry, PlacesTheRenderedFlightsWithinTwoPercentOfTheirPath)
{
  const std::string folder = std::string(BOLE_SHARED_DATA_DIR) + "/rendered/winter-weave";
  if (!std::filesystem::exists(folder))
    GTEST_SKIP() << folder << " is absent";
  AslSource source(folder);
  PointTracker tracker(source.camera());
  PointOdometry odometry(source.camera());
  std::vector<Eigen::Vector3d> truth;
  Frame frame;
  double length = 0;
  while (source.next(frame)) {
    tracker.track(frame.image);
    odometry.process(tracker);
    truth.push_back((*frame.wMb_truth * source.bMc()).t);
    length += truth.size() > 1 ? (truth.back() - truth[truth.size() - 2]).norm() : 0;
  }
  const auto path = odometry.trajectory();
  const auto n = static_cast<Eigen::Index>(truth.size());
  Eigen::Matrix3Xd estimate(3, n), reference(3, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    estimate.col(k) = path[static_cast<std::size_t>(k)].wMc.t;
    reference.col(k) = truth[static_cast<std::size_t>(k)];
  }
  const Eigen::Matrix4d aligned = Eigen::umeyama(estimate, reference, true);
  const Eigen::Matrix3Xd moved = (aligned.topLeftCorner<3, 3>() * estimate).colwise() + aligned.topRightCorner<3, 1>();
  EXPECT_LT(std::sqrt((moved - reference).squaredNorm() / double(n)), 0.01 * length);
}

/// Dark leaning bars on a bright sky, all towards the image of \p up.
vpImage<unsigned char> drawTrunks(const PinholeCamera &camera, const Eigen::Vector3d &up)
{
  vpImage<unsigned char> image(static_cast<unsigned>(camera.height), static_cast<unsigned>(camera.width), 220);
  for (const double bearing : {-0.6, -0.35, -0.1, 0.15, 0.4, 0.65}) {
    const Eigen::Vector3d side = up.cross(Eigen::Vector3d(0, 0, 1)).normalized(), ahead = side.cross(up);
    const Eigen::Vector3d foot = std::cos(bearing) * ahead + std::sin(bearing) * side;
    const Eigen::Vector3d normal = foot.cross(up).normalized();
    for (unsigned y = 0; y < image.getHeight(); ++y) {
      for (unsigned x = 0; x < image.getWidth(); ++x) {
        // Half a pixel of smooth border: stairs would bend the gradients towards the axes.
        const double off = std::abs(normal.dot(camera.ray({double(x), double(y)}).normalized()));
        const double dark = std::clamp((0.02 - off) * 0.7 * camera.fx + 0.5, 0.0, 1.0);
        image[y][x] = std::min(image[y][x], static_cast<unsigned char>(220 - 160 * dark));
      }
    }
  }
  return image;
}

/// Up from one image alone.
VerticalEstimate upIn(const vpImage<unsigned char> &image, const PinholeCamera &camera,
                      const std::optional<Eigen::Vector3d> &expected = std::nullopt)
{
  return VerticalFinder().find(image, camera, Eigen::Matrix3d::Identity(), expected);
}

TEST(Vertical, TrunksPointToTheZenith)
{
  for (const Eigen::Vector3d &tilt :
       {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.1, 0, -0.12), Eigen::Vector3d(-0.15, 0, 0.2)}) {
    const Eigen::Vector3d up = expSo3(tilt) * Eigen::Vector3d(0, -1, 0);
    const auto estimate = upIn(drawTrunks(kCamera, up), kCamera);
    EXPECT_TRUE(estimate.known);
    EXPECT_LT(directionMinus(up, estimate.up).norm(), 0.02) << tilt.transpose();
  }
}

TEST(Vertical, SmallPicturesTellTogetherWhatEachCannot)
{
  PinholeCamera small = kCamera;
  small.width = 100;
  small.height = 18;
  small.fx = small.fy = 70;
  small.cx = 49.5;
  small.cy = 8.5;
  const Eigen::Vector3d w_up = expSo3({0.05, 0, -0.15}) * Eigen::Vector3d(0, -1, 0); // in the first camera
  VerticalFinder finder;
  VerticalEstimate together;
  Eigen::Matrix3d wRc = Eigen::Matrix3d::Identity();
  for (int k = 0; k < 8; ++k) {
    wRc = expSo3({0, 0.03 * k, 0.02 * k});
    const auto image = drawTrunks(small, wRc.transpose() * w_up);
    EXPECT_FALSE(upIn(image, small).known);
    together = finder.find(image, small, wRc, std::nullopt);
  }
  EXPECT_TRUE(together.known);
  const Eigen::Vector3d up = wRc.transpose() * w_up;
  EXPECT_LT(std::abs(std::atan2(together.up.x(), -together.up.y()) - std::atan2(up.x(), -up.y())), 0.03); // roll
}

TEST(Vertical, ANarrowFieldOfViewDoesNotTakeTheOpticalAxisForTheZenith)
{
  PinholeCamera narrow = kCamera;
  narrow.fx = narrow.fy = 1300;
  const Eigen::Vector3d up = expSo3({0.05, 0, -0.06}) * Eigen::Vector3d(0, -1, 0);
  const auto estimate = upIn(drawTrunks(narrow, up), narrow);
  EXPECT_LT(std::abs(std::atan2(estimate.up.x(), -estimate.up.y()) - std::atan2(up.x(), -up.y())), 0.02); // roll
  EXPECT_LT(std::abs(estimate.up.z()), 0.3);
}

/// The roll of a narrow view is seen, its pitch is not; a pan turns the one into the other.
TEST(VerticalFilter, APanTellsThePitchThatOneNarrowViewCannot)
{
  PinholeCamera narrow = kCamera;
  narrow.fx = narrow.fy = 1300;
  const Eigen::Vector3d w_up = expSo3({0.12, 0, 0}) * Eigen::Vector3d(0, -1, 0); // in the first camera: pitched
  VerticalFilter filter;
  Eigen::Matrix3d wRc = Eigen::Matrix3d::Identity();
  for (int k = 0; k <= 30; ++k) {
    wRc = expSo3(-0.025 * k * w_up);
    filter.add(wRc, VerticalFinder().find(drawTrunks(narrow, wRc.transpose() * w_up), narrow, wRc, std::nullopt));
  }
  EXPECT_LT(directionMinus(filter.up(), w_up).norm(), 0.03);
  const Eigen::Vector3d up = wRc.transpose() * filter.up();
  EXPECT_NEAR(std::atan2(up.x(), -up.y()), 0, 0.01); // roll in the last view
}

TEST(VerticalFilter, FollowsAPathThatDrifts)
{
  VerticalEstimate seen;
  seen.known = true;
  seen.information = 400 * Eigen::Matrix2d::Identity();
  seen.share = 1;
  VerticalFilter filter;
  Eigen::Matrix3d drift = Eigen::Matrix3d::Identity();
  for (int k = 0; k < 600; ++k) {
    drift = expSo3({0, 0, 0.0005 * k});
    seen.up = Eigen::Vector3d(0, -1, 0);
    filter.add(drift, seen);
  }
  EXPECT_LT(directionMinus(drift.transpose() * filter.up(), seen.up).norm(), 0.05);
}

TEST(Vertical, EdgesAtRandomTellNothing)
{
  std::mt19937 random(3);
  std::uniform_real_distribution<double> at(0, 1);
  cv::Mat grey(240, 320, CV_8U, cv::Scalar(128));
  for (int i = 0; i < 120; ++i) {
    const cv::Point2d p(320 * at(random), 240 * at(random));
    const double angle = M_PI * at(random);
    cv::line(grey, p, p + 40 * cv::Point2d(std::cos(angle), std::sin(angle)), cv::Scalar(at(random) < 0.5 ? 20 : 235),
             3);
  }
  vpImage<unsigned char> image(240, 320);
  std::copy(grey.datastart, grey.dataend, image.bitmap);
  EXPECT_FALSE(upIn(image, kCamera).known);
}

TEST(Vertical, AnImageWithoutEdgesKeepsWhatWasExpected)
{
  const Eigen::Vector3d expected = Eigen::Vector3d(0.1, -1, 0.1).normalized();
  const auto estimate = upIn(vpImage<unsigned char>(240, 320, 99), kCamera, expected);
  EXPECT_FALSE(estimate.known);
  EXPECT_LT((estimate.up - expected).norm(), 1e-12);
  EXPECT_TRUE(estimate.information.isZero(0));
}

std::vector<PointDepth> groundPoints(double height, const Eigen::Vector3d &up, double bushes, unsigned seed)
{
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  std::normal_distribution<double> normal;
  std::vector<PointDepth> points;
  while (points.size() < 60) {
    PointDepth point;
    point.pixel = {319 * unit(random), 239 * unit(random)};
    const double below = -up.dot(kCamera.ray(point.pixel));
    if (below <= 0.02) {
      point.inverse_depth = 0.1; // a trunk above the horizon
    }
    else {
      const double over = unit(random) < bushes ? 0.6 * unit(random) * height : 0;
      point.inverse_depth = below / (height - over);
    }
    point.sigma = 0.03 * point.inverse_depth;
    point.inverse_depth += point.sigma * normal(random);
    points.push_back(point);
  }
  return points;
}

TEST(GroundPlane, FindsTheHeightUnderBushes)
{
  const Eigen::Vector3d up = expSo3({0.05, 0, 0.1}) * Eigen::Vector3d(0, -1, 0);
  for (unsigned seed = 1; seed <= 8; ++seed) {
    const auto ground = heightOverGround(groundPoints(1.4, up, 0.33, seed), kCamera, up);
    ASSERT_TRUE(ground.known);
    EXPECT_NEAR(ground.height, 1.4, 3 * ground.sigma) << seed;
    EXPECT_NEAR(ground.height, 1.4, 0.12) << seed;
  }
}

TEST(GroundPlane, NothingBelowTheHorizonIsNoGround)
{
  std::vector<PointDepth> sky(40);
  for (auto &point : sky) {
    point.pixel = {160, 40};
    point.inverse_depth = 0.1;
    point.sigma = 0.001;
  }
  EXPECT_FALSE(heightOverGround(sky, kCamera, {0, -1, 0}).known);
}

TEST(GroundPlane, ScaleIsARobustMeanOverFrames)
{
  ScaleFromHeight scale;
  for (int k = 0; k < 30; ++k)
    scale.add({true, k % 6 == 0 ? 0.4 : 0.7 + 0.01 * (k % 3 - 1), 0.02}, 1.4, 0.02);
  ASSERT_TRUE(scale.known());
  EXPECT_NEAR(scale.metresPerUnit(), 2.0, 0.06);
  EXPECT_GT(scale.relativeSigma(), 0.03);
}
} // namespace
