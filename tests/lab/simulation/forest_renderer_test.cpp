// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "simulation/forest.h"
#include "simulation/forest_renderer.h"
#include "simulation/random.h"
#include "simulation/simulated_flight.h"
#include "support/h264.h"
#include "support/units.h"

using namespace bole;

namespace
{
/// A single straight pole 4 m ahead on flat ground, and scenery without a tree.
Forest singlePole(Light light = Light::overcast)
{
  ForestOptions options;
  options.density = 0;
  options.undergrowth = options.saplings = options.ground_amplitude = options.crown_leaves = 0;
  options.light = light;
  SimulatedTrunk pole;
  pole.foot = {4, 0.3, 0};
  pole.radius = 0.2;
  pole.taper = pole.flare = 0;
  return Forest::plant(options, {{0, 0, 1.2}}, {pole});
}

Pose cameraAt(const Eigen::Vector3d &t, const Eigen::Vector3d &turn = Eigen::Vector3d::Zero())
{
  return Pose(expSo3(turn), t) * forwardCamera();
}

/// First and last column of trunk 0 in a row.
std::pair<int, int> columnsOfTrunk(const RenderedFrame &frame, int row)
{
  int first = -1, last = -1;
  for (int column = 0; column < static_cast<int>(frame.trunk_id.getWidth()); ++column) {
    if (frame.trunk_id[row][column] == 0) {
      first = first < 0 ? column : first;
      last = column;
    }
  }
  return {first, last};
}

class SeenPole : public testing::Test
{
protected:
  /// The trunk as the camera sees it from \p wMc.
  RelativeTrunk relativeFrom(const Pose &wMc) const
  {
    return relativeTrunk(wMc, Pose(), m_forest.trunks.front().cylinder());
  }
  const Forest m_forest = singlePole();
  RenderedFrame m_frame;
};

TEST_F(SeenPole, ItsBordersAreThoseOfTheRelativeTrunk)
{
  ForestRenderer renderer(m_forest, {});
  const Pose wMc = cameraAt({0, 0, 1.2}, {0.05, 0.03, 0.04});
  renderer.render(wMc, m_frame, true);

  const RelativeTrunk relative = relativeFrom(wMc);
  const PinholeCamera camera = renderer.camera().pinhole;
  double left_error = 0, right_error = 0;
  int rows = 0;
  for (double elevation = -0.2; elevation < 0.4; elevation += 0.005, ++rows) {
    // The border's line through two of its points, at the centre of the row.
    const auto columnAt = [&](Border border, int row) {
      const Eigen::Vector2d a = camera.project(relative.borderDirection(border, -0.2));
      const Eigen::Vector2d b = camera.project(relative.borderDirection(border, 0.4));
      return a.x() + (b.x() - a.x()) * (row - a.y()) / (b.y() - a.y());
    };
    const int row =
        static_cast<int>(std::lround(camera.project(relative.borderDirection(Border::left, elevation)).y()));
    const auto [first, last] = columnsOfTrunk(m_frame, row);
    const double left = first - 0.5 - columnAt(Border::left, row), right = last + 0.5 - columnAt(Border::right, row);
    left_error += left;
    right_error += right;
    EXPECT_NEAR(left, 0, 0.7);
    EXPECT_NEAR(right, 0, 0.7);
  }
  EXPECT_NEAR(left_error / rows, 0, 0.1);
  EXPECT_NEAR(right_error / rows, 0, 0.1);
}

TEST_F(SeenPole, DepthIsAlongTheOpticalAxis)
{
  ForestRenderer renderer(m_forest, {});
  renderer.render(cameraAt({0, 0, 1.2}), m_frame, true);
  const int column = static_cast<int>(std::lround(159.5 - 200 * 0.3 / 4));
  EXPECT_EQ(m_frame.trunk_id[120][column], 0);
  EXPECT_NEAR(m_frame.depth[120][column], 3800, 10);
  // Ground: 1.2 m below the camera, seen (v - cy) / f below the horizon.
  EXPECT_NEAR(m_frame.depth[219][20], 1200 * 200 / 99.5, 10);
  EXPECT_EQ(m_frame.trunk_id[219][20], 65535);
  EXPECT_EQ(m_frame.depth[5][20], 65535);
}

TEST_F(SeenPole, MotionBlursWhatAStillCameraSeesSharp)
{
  RendererOptions options;
  options.read_noise = options.shot_noise = 0;
  options.samples_per_pixel = 16;
  ForestRenderer renderer(m_forest, options);
  RenderedFrame still, moving;
  renderer.render(cameraAt({0, 0, 1.2}), still);
  renderer.render(cameraAt({0, 0, 1.2}, {0, 0, -0.03}), cameraAt({0, 0, 1.2}, {0, 0, 0.03}), moving);
  const auto steepest = [](const vpImage<unsigned char> &image) {
    int most = 0;
    for (unsigned column = 90; column < 230; ++column)
      most = std::max(most, std::abs(int(image[60][column + 1]) - int(image[60][column])));
    return most;
  };
  EXPECT_LT(2 * steepest(moving.image), steepest(still.image));
}

TEST(ForestRenderer, SunCastsTheShadowOfATrunk)
{
  RendererOptions options;
  options.read_noise = options.shot_noise = 0;
  const Forest forest = singlePole(Light::sun);
  ForestRenderer renderer(forest, options);
  // Straight down on the shadow, 1.5 m beside the foot, away from the sun.
  const Eigen::Vector3d away = Eigen::Vector3d(-forest.to_sun.x(), -forest.to_sun.y(), 0).normalized();
  const Eigen::Vector3d above = forest.trunks.front().foot + 1.5 * away + Eigen::Vector3d(0, 0, 1.2);
  Eigen::Matrix3d down;
  down << 0, -1, 0, -1, 0, 0, 0, 0, -1;
  RenderedFrame frame;
  renderer.render(Pose(down, above), frame);
  const Eigen::Vector3d side = Eigen::Vector3d::UnitZ().cross(away);
  const auto grey = [&](const Eigen::Vector3d &offset) {
    const Eigen::Vector3d p = down.transpose() * (offset - Eigen::Vector3d(0, 0, 1.2));
    const Eigen::Vector2d u = renderer.camera().pinhole.project(p);
    double sum = 0;
    for (int dy = -12; dy <= 12; ++dy)
      for (int dx = -12; dx <= 12; ++dx)
        sum += frame.image[static_cast<int>(u.y()) + dy][static_cast<int>(u.x()) + dx];
    return sum / 625;
  };
  const Eigen::Vector3d none = Eigen::Vector3d::Zero();
  EXPECT_LT(1.2 * grey(none), grey(0.45 * side));
  EXPECT_LT(1.2 * grey(none), grey(-0.45 * side));
}

TEST_F(SeenPole, AutomaticExposureReachesItsTargetInSteps)
{
  RendererOptions options;
  options.exposure_target = 100;
  ForestRenderer renderer(m_forest, options);
  renderer.render(cameraAt({0, 0, 1.2}), m_frame);
  const unsigned size = m_frame.image.getSize();
  EXPECT_NEAR(std::accumulate(m_frame.image.bitmap, m_frame.image.bitmap + size, 0.0) / size, 100, 6);
  const double steps = std::log(m_frame.gain) / std::log1p(options.gain_step);
  EXPECT_NEAR(steps, std::round(steps), 1e-9);
}

TEST_F(SeenPole, LensBendsThePicture)
{
  RendererOptions options;
  options.camera = {{215.1, 215.8, 160.7, 123.3, 320, 240}, Distortion::fov, {{0.272, 0, 0, 0}}};
  ForestRenderer renderer(m_forest, options);
  const Pose wMc = cameraAt({0, 0, 1.2}, {0, 0, 0.6}); // the trunk near the right border
  renderer.render(wMc, m_frame, true);
  const RelativeTrunk relative = relativeFrom(wMc);
  const auto bent = [&](Border border) {
    const Eigen::Vector3d d = relative.borderDirection(border, 0);
    return options.camera.distort(d.head<2>() / d.z());
  };
  const Eigen::Vector2d left = bent(Border::left), right = bent(Border::right);
  ASSERT_LT(right.x(), 318);
  const auto [first, last] = columnsOfTrunk(m_frame, static_cast<int>(std::lround(left.y())));
  EXPECT_NEAR(first, left.x(), 1.0);
  EXPECT_NEAR(last, right.x(), 1.0);
}

TEST(H264Link, LowerBitRateLosesMore)
{
  const Forest forest = singlePole();
  const auto lossAt = [&](double kbps, std::size_t *bytes) {
    ForestRenderer renderer(forest, {});
    H264Link link(320, 240, 15, kbps);
    RenderedFrame frame;
    double loss = 0;
    for (int k = 0; k < 10; ++k) {
      renderer.render(cameraAt({0.05 * k, 0, 1.2}), frame);
      const vpImage<unsigned char> sent = frame.image;
      link.pass(frame.image);
      *bytes += link.lastBytes();
      for (unsigned n = 0; n < sent.getSize(); ++n)
        loss += std::abs(int(sent.bitmap[n]) - int(frame.image.bitmap[n]));
    }
    return loss / (10.0 * 320 * 240);
  };
  std::size_t few = 0, many = 0;
  const double high_loss = lossAt(200, &few), low_loss = lossAt(4000, &many);
  EXPECT_GT(high_loss, 1.3 * low_loss);
  EXPECT_LT(low_loss, 5);
  EXPECT_LT(2 * few, many);
}

TEST(H264Link, RefusesOddSizes) { EXPECT_THROW(H264Link(321, 240, 15, 1000), vpException); }

std::vector<Eigen::Vector3d> straightPath(double length)
{
  std::vector<Eigen::Vector3d> path;
  for (double x = 0; x <= length; x += 0.1)
    path.push_back({x, 0, 1.2});
  return path;
}

TEST(Forest, HasTheDensityThatWasAskedFor)
{
  ForestOptions options;
  options.density = 0.05;
  const Forest forest = Forest::plant(options, straightPath(40));
  const double area = (forest.near_max - forest.near_min).prod();
  EXPECT_NEAR(forest.trunks.size() / area, 0.05, 0.002);
}

TEST(Forest, LeavesThePathFree)
{
  ForestOptions options;
  options.density = 0.2;
  options.clearance = 0.9;
  const std::vector<Eigen::Vector3d> path = straightPath(20);
  const Forest forest = Forest::plant(options, path);
  for (const Eigen::Vector3d &point : path) {
    EXPECT_GT(forest.distanceToBark(point),
              0.7); // lean and bow may take something of the clearance
  }
}

TEST(Forest, WantedTrunksComeFirstWithTheirFootOnTheGround)
{
  SimulatedTrunk wanted;
  wanted.foot = {3, 1, 99};
  wanted.radius = 0.33;
  const Forest forest = Forest::plant({}, straightPath(5), {wanted});
  EXPECT_EQ(forest.trunks.front().id, 0);
  EXPECT_DOUBLE_EQ(forest.trunks.front().radius, 0.33);
  EXPECT_DOUBLE_EQ(forest.trunks.front().foot.z(), forest.terrain.height(3, 1));
}

TEST(SimulatedTrunk, HasItsRadiusAtBreastHeight)
{
  SimulatedTrunk trunk;
  trunk.radius = 0.2;
  EXPECT_NEAR(trunk.radiusAt(1.3), 0.2, 1e-4);
  EXPECT_GT(trunk.radiusAt(0), 0.25);
  EXPECT_LT(trunk.radiusAt(6), 0.19);
}

TEST(SimulatedTrunk, CylinderPassesThroughTheAxisWhereADroneLooks)
{
  SimulatedTrunk trunk;
  trunk.foot = {4, -2, 0.3};
  trunk.lean = {0.03, -0.02};
  trunk.bow = {0.05, 0.02};
  const Trunk cylinder = trunk.cylinder();
  EXPECT_NEAR((cylinder.axisAt(0.3 + 0.6) - trunk.axisAt(0.6)).norm(), 0, 1e-12);
  EXPECT_NEAR((cylinder.axisAt(0.3 + 2.0) - trunk.axisAt(2.0)).norm(), 0, 1e-12);
  EXPECT_LT((cylinder.axisAt(0.3 + 1.3) - trunk.axisAt(1.3)).norm(), 0.005);
}

TEST(Terrain, IsFlatAtTheOriginAndSmooth)
{
  const Terrain terrain(5, 0.1);
  EXPECT_NEAR(terrain.height(0, 0), 0, 1e-12);
  for (double x = -20; x < 20; x += 0.37)
    EXPECT_LT(std::abs(terrain.height(x + 0.01, 2) - terrain.height(x, 2)), 0.01);
}
} // namespace
