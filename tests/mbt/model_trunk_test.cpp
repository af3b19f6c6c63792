// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/drawn_trunks.h"
#include "support/test.h"

#include "mbt/model_trunk.h"
#include "mbt/pose_estimator.h"
#include <visp3/core/vpCylinder.h>
#include <visp3/core/vpExponentialMap.h>

namespace
{
using namespace bole;
using test::cameraAt;

const PinholeCamera kCamera;
const vpMbTrunkTracker::Options kOptions;

Cylinder leaning() { return {{4, 0.8, 0}, {4.2, 0.6, 3}, 0.2, ""}; }

BorderPlane planeAt(const Pose &cMo, const Cylinder &trunk, Border side)
{
  const Cylinder c = cMo * trunk;
  return BorderPlane(c, relativeTrunk(c), side);
}

/// The pose after the camera has moved by the twist t * e_i, as ViSP moves it.
Pose movedAlong(const Pose &cMo, int i, double t)
{
  vpColVector v(6, 0.);
  v[unsigned(i)] = t;
  return Pose::fromVisp(vpExponentialMap::direct(v).inverse() * cMo.toVisp());
}

Row6d centralDifferences(const Pose &cMo, Border side, const Eigen::Vector3d &m, double h)
{
  Row6d numeric;
  for (int i = 0; i < 6; ++i)
    numeric(i) = (planeAt(movedAlong(cMo, i, h), leaning(), side).residual(m) -
                  planeAt(movedAlong(cMo, i, -h), leaning(), side).residual(m)) /
                 (2 * h);
  return numeric;
}

TEST(BorderPlane, InteractionMatrixAgreesWithCentralDifferencesAtTwoStepSizes)
{
  for (const Pose &cMo : {cameraAt({0, 0, 1.2}), cameraAt({1, 0.5, 2}, 0.2, 0.3), cameraAt({-2, -1, 0.5}, -0.1, -0.2)})
    for (const Border side : kBorders)
      for (const Eigen::Vector3d &m : {Eigen::Vector3d(-0.1, 0.3, 1), Eigen::Vector3d(0.2, -0.4, 1)}) {
        Row6d L;
        double by_log_radius = 0;
        planeAt(cMo, leaning(), side).derive(m, L, by_log_radius);
        const double wide = (centralDifferences(cMo, side, m, 2e-2) - L).norm(),
                     narrow = (centralDifferences(cMo, side, m, 1e-2) - L).norm();
        EXPECT_LT(narrow, 2e-3 * (1 + L.norm()));
        EXPECT_NEAR(wide / narrow, 4, 0.3);
      }
}

TEST(BorderPlane, DerivativeByTheRadiusAgreesWithCentralDifferencesAtTwoStepSizes)
{
  const Pose cMo = cameraAt({0, 0, 1.2}, 0.1);
  const Eigen::Vector3d m(0.2, -0.1, 1);
  Row6d L;
  double by_log_radius = 0;
  planeAt(cMo, leaning(), Border::left).derive(m, L, by_log_radius);
  const auto errorAt = [&](double h) {
    Cylinder wider = leaning(), thinner = leaning();
    wider.radius *= std::exp(h), thinner.radius *= std::exp(-h);
    return (planeAt(cMo, wider, Border::left).residual(m) - planeAt(cMo, thinner, Border::left).residual(m)) / (2 * h) -
           by_log_radius;
  };
  EXPECT_LT(std::abs(errorAt(0.1)), 0.01 * std::abs(by_log_radius));
  EXPECT_NEAR(errorAt(0.2) / errorAt(0.1), 4, 0.3);
}

TEST(BorderPlane, SidewaysIsHowFarTheBorderMovesInARowOfTheImage)
{
  const Pose cMo = cameraAt({0, 0, 1.2}, 0.05, 0.02);
  const auto columnAt = [&](const Pose &pose) { // of the left border on row 100
    const Eigen::Vector3d n = planeAt(pose, leaning(), Border::left).normal();
    const double y = (100 - kCamera.cy) / kCamera.fy;
    return kCamera.cx - kCamera.fx * (n.z() + n.y() * y) / n.x();
  };
  const Eigen::Vector3d m = kCamera.ray({columnAt(cMo), 100});
  const Row6d moves = planeAt(cMo, leaning(), Border::left).sideways(kCamera, m, false);
  for (int i = 0; i < 6; ++i) {
    const double h = 1e-4, numeric = (columnAt(movedAlong(cMo, i, h)) - columnAt(movedAlong(cMo, i, -h))) / (2 * h);
    EXPECT_NEAR(moves(i), numeric, 1e-4 * moves.norm()) << i;
  }
}

TEST(ModelTrunk, ThePeakOfADrawnBorderIsWhereTheModelHasIt)
{
  const Pose cMo = cameraAt({0, 0, 1.2}, 0.05, 0.1);
  const vpImage<unsigned char> I = test::drawTrunks(kCamera, cMo, test::smallWood(), 3);
  for (const Cylinder &model : test::smallWood()) {
    ModelTrunk trunk(model);
    trunk.predict(cMo, kCamera, kOptions);
    trunk.scan(I, 4, kOptions.min_contrast);
    for (ModelBorder &border : trunk.borders()) {
      ASSERT_TRUE(border.visible);
      BorderPeak best;
      for (const BorderPeak &peak : border.peaks)
        if (std::abs(peak.contrast) > std::abs(best.contrast))
          best = peak;
      EXPECT_LT(std::abs(best.offset_px), 0.25);
      EXPECT_GT(std::abs(best.contrast), 5);
      // the background is brighter: the contrast rises out of the trunk
      EXPECT_EQ(best.contrast > 0, &border == &trunk.borders()[1]);
    }
  }
}

TEST(ModelTrunk, RowsBehindANearerTrunkAreNotRead)
{
  ModelTrunk near(test::uprightTrunk(3, 0.1, 0.3)), far(test::uprightTrunk(8, 1.0, 0.2));
  for (ModelTrunk *trunk : {&near, &far}) {
    trunk->predict(cameraAt({0, 0, 1.2}), kCamera, kOptions);
    ASSERT_TRUE(trunk->borders()[0].visible && trunk->borders()[1].visible);
  }
  far.hideBehind(near, kCamera, kOptions); // its right border is behind the near trunk, its left one is not
  near.hideBehind(far, kCamera, kOptions);
  EXPECT_TRUE(far.borders()[0].visible);
  EXPECT_FALSE(far.borders()[1].visible);
  EXPECT_TRUE(near.borders()[0].visible && near.borders()[1].visible);
}

TEST(ModelTrunk, KnowsABorderByItsProfile)
{
  ModelTrunk trunk(test::uprightTrunk(4, 0.5, 0.15));
  // two trunks, side by side: the other's left border has the contrast of ours, but not its neighbourhood
  const std::vector<Cylinder> two = {test::uprightTrunk(4, 0.5, 0.15), test::uprightTrunk(4, 0.7, 0.02)};
  trunk.predict(cameraAt({0, 0, 1.2}), kCamera, kOptions);
  trunk.scan(test::drawTrunks(kCamera, cameraAt({0, 0, 1.2}), two, 1), 3, kOptions.min_contrast);
  EXPECT_EQ(trunk.borders()[0].likeness(0), 0); // nothing remembered yet
  for (ModelBorder &border : trunk.borders()) {
    int strongest = 0;
    for (int p = 0; p < int(border.peaks.size()); ++p)
      if (std::abs(border.peaks[std::size_t(p)].contrast) > std::abs(border.peaks[std::size_t(strongest)].contrast))
        strongest = p;
    trunk.choose(border, strongest, 3, kCamera, kOptions.min_contrast);
  }
  trunk.remember();
  const Pose moved = cameraAt({0, 0.04, 1.2}); // everything goes 2 px to the right in the image
  trunk.scan(test::drawTrunks(kCamera, moved, two, 2), 14, kOptions.min_contrast);
  const ModelBorder &left = trunk.borders()[0];
  const double own = std::max(left.likeness(2), left.likeness(1)); // whole pixels: it may lie between two
  EXPECT_GT(own, 0.85);
  int others = 0;
  for (const BorderPeak &peak : left.peaks)
    if (std::abs(peak.offset_px - 2) > 2) {
      ++others;
      EXPECT_LT(left.likeness(int(std::lround(peak.offset_px))), own - 0.2) << peak.offset_px;
    }
  EXPECT_GT(others, 0);
  EXPECT_EQ(left.likeness(1000), 0); // beyond the scan
}

TEST(BorderVote, AllBordersTogetherFindATwistThatOneAloneDoesNot)
{
  // borders that move by their own share of two directions; each has its true maximum and a stronger wrong one
  std::vector<BallotBorder> borders;
  for (int b = 0; b < 12; ++b) {
    BallotBorder border;
    border.offset_by_twist << 100 * std::cos(0.5 * b), 0, 100 * std::sin(0.5 * b), 0, 0, 0;
    const double truth = 100 * (0.06 * std::cos(0.5 * b) - 0.03 * std::sin(0.5 * b));
    border.response.assign(41, 0.f);
    for (int k = -1; k <= 1; ++k)
      border.response[std::size_t(20 + int(std::lround(truth)) + k)] = k == 0 ? 0.8f : 0.7f;
    border.response[std::size_t((7 * b + 3) % 41)] = 1.f;
    borders.push_back(border);
  }
  const Matrix6d covariance = Matrix6d::Identity() * 0.05 * 0.05;
  const Vote result = vote(borders, covariance);
  EXPECT_NEAR(result.twist(0), 0.06, 0.015);
  EXPECT_NEAR(result.twist(2), -0.03, 0.015);
  EXPECT_GT(result.score, 0.6);
  EXPECT_EQ(vote({}, covariance).twist.norm(), 0);
}
} // namespace
