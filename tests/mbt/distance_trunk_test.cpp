// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/drawn_trunks.h"

#include "mbt/vpMbtDistanceTrunk.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <visp3/core/vpCylinder.h>
#include <visp3/core/vpExponentialMap.h>

namespace
{
using namespace bole;
using test::cameraAt;
using Row = Eigen::Matrix<double, 1, 6>;

Cylinder leaning()
{
  Cylinder trunk;
  trunk.foot = {4, 0.8, 0};
  trunk.top = {4.2, 0.6, 3};
  trunk.radius = 0.2;
  return trunk;
}

/// The pose after the camera has moved by the twist t * e_i, as ViSP moves it.
Pose movedBy(const Pose &cMo, int i, double t)
{
  vpColVector v(6, 0.);
  v[unsigned(i)] = t;
  return Pose::fromVisp(vpExponentialMap::direct(v).inverse() * cMo.toVisp());
}

double residualAt(const Pose &cMo, const Cylinder &trunk, Border side, const Eigen::Vector3d &m)
{
  return vpMbtDistanceTrunk::residual(cMo * trunk, side, m);
}

double differenceFrom(const Row &L, const Pose &cMo, const Cylinder &trunk, Border side, const Eigen::Vector3d &m,
                      double h)
{
  Row numeric;
  for (int i = 0; i < 6; ++i)
    numeric(i) =
        (residualAt(movedBy(cMo, i, h), trunk, side, m) - residualAt(movedBy(cMo, i, -h), trunk, side, m)) / (2 * h);
  return (numeric - L).norm();
}

TEST(DistanceTrunk, InteractionMatrixAgreesWithCentralDifferencesAtTwoStepSizes)
{
  for (const Pose &cMo : {cameraAt({0, 0, 1.2}), cameraAt({1, 0.5, 2}, 0.2, 0.3), cameraAt({-2, -1, 0.5}, -0.1, -0.2)})
    for (const Border side : {Border::left, Border::right})
      for (const Eigen::Vector3d &m : {Eigen::Vector3d(-0.1, 0.3, 1), Eigen::Vector3d(0.2, -0.4, 1)}) {
        Row L;
        vpMbtDistanceTrunk::residual(cMo * leaning(), side, m, &L);
        const double wide = differenceFrom(L, cMo, leaning(), side, m, 2e-2),
                     narrow = differenceFrom(L, cMo, leaning(), side, m, 1e-2);
        EXPECT_LT(narrow, 2e-3 * (1 + L.norm()));
        EXPECT_NEAR(wide / narrow, 4, 0.3);
      }
}

TEST(DistanceTrunk, ResidualOfAPointOfTheBorderIsZero)
{
  const Cylinder c = cameraAt({0, 0, 1.2}, 0.1) * leaning();
  const RelativeTrunk relative = relativeTrunk(c);
  for (const Border side : {Border::left, Border::right}) {
    const ContactLine line = contactLine(c, relative, side);
    for (const double t : {0.1, 0.5, 0.9}) {
      const Eigen::Vector3d p = line.foot + t * (line.top - line.foot);
      EXPECT_NEAR(vpMbtDistanceTrunk::residual(c, side, p / p.z()), 0, 1e-12);
    }
  }
}

TEST(DistanceTrunk, BordersAreThoseOfVpCylinder)
{
  const Cylinder trunk = leaning();
  const Pose cMo = cameraAt({0, 0, 1.2}, 0.1);
  const Eigen::Vector3d a = trunk.axis();
  vpCylinder cylinder(a.x(), a.y(), a.z(), trunk.foot.x(), trunk.foot.y(), trunk.foot.z(), trunk.radius);
  cylinder.track(cMo.toVisp());
  // a point of each limb of ViSP (rho = x cos theta + y sin theta) lies on one of our borders
  for (const auto &[rho, theta] :
       {std::pair(cylinder.getRho1(), cylinder.getTheta1()), std::pair(cylinder.getRho2(), cylinder.getTheta2())}) {
    const Eigen::Vector3d m(rho * std::cos(theta) - 0.3 * std::sin(theta),
                            rho * std::sin(theta) + 0.3 * std::cos(theta), 1);
    const double left = residualAt(cMo, trunk, Border::left, m), right = residualAt(cMo, trunk, Border::right, m);
    EXPECT_LT(std::min(std::abs(left), std::abs(right)), 1e-9);
    EXPECT_GT(std::max(std::abs(left), std::abs(right)), 1e-2);
  }
}

TEST(DistanceTrunk, AnUprightTrunkSaysNothingAlongItsAxisNorAboutIt)
{
  const Cylinder c = cameraAt({0, 0, 1.2}, 0.3, 0.2) * test::uprightTrunk(4, 0.8, 0.2);
  Row L;
  vpMbtDistanceTrunk::residual(c, Border::left, {0.1, 0.2, 1}, &L);
  const Eigen::Vector3d axis = c.axis();
  Vector6d along, about; // the camera moves along the axis; it turns about it, axis through the foot of the trunk
  along << axis, Eigen::Vector3d::Zero();
  about << -axis.cross(c.foot), axis;
  EXPECT_NEAR(L * along, 0, 1e-12);
  EXPECT_NEAR(L * about, 0, 1e-12);
}

TEST(DistanceTrunk, FeaturesOfADrawnTrunkServoAPoseWithoutTheTracker)
{
  const PinholeCamera camera;
  const std::vector<Cylinder> wood = test::smallWood();
  const Pose truth = cameraAt({0, 0, 1.2});
  const vpImage<unsigned char> I = test::drawTrunks(camera, truth, wood);
  vpHomogeneousMatrix cMo = cameraAt({0.05, 0.04, 1.2}, 0.008).toVisp();
  std::vector<vpMbtDistanceTrunk> trunks(wood.size());
  for (int iteration = 0; iteration < 20; ++iteration) { // as a user of ViSP stacks features
    for (std::size_t k = 0; k < wood.size() && iteration % 10 == 0; ++k) {
      trunks[k].buildFrom(wood[k]);
      trunks[k].setCameraParameters(camera.toVisp());
      trunks[k].predict(cMo, I.getWidth(), I.getHeight());
      ASSERT_TRUE(trunks[k].isVisible());
      trunks[k].search(I, 6);
      trunks[k].initInteractionMatrixError();
      ASSERT_GT(trunks[k].nbFeature, 4u);
    }
    vpMatrix L;
    vpColVector error;
    for (vpMbtDistanceTrunk &trunk : trunks) {
      trunk.computeInteractionMatrixError(cMo);
      L.stack(trunk.L);
      error.stack(trunk.error);
    }
    const vpColVector v = -1.0 * (L.pseudoInverse(1e-4) * error);
    cMo = vpExponentialMap::direct(v).inverse() * cMo;
  }
  const Pose found = Pose::fromVisp(cMo);
  const Eigen::Vector3d off = found.inverse().t - truth.inverse().t;
  EXPECT_LT(off.head<2>().norm(), 0.02); // of 0.06 at the start; the height is not observable
  EXPECT_LT(test::radiansApart(found, truth), 0.003);
}

TEST(DistanceTrunk, SamplesBehindANearerTrunkAreHidden)
{
  vpMbtDistanceTrunk near, far;
  near.buildFrom(test::uprightTrunk(3, 0.1, 0.3));
  far.buildFrom(test::uprightTrunk(8, 1.0, 0.2));
  for (vpMbtDistanceTrunk *trunk : {&near, &far}) {
    trunk->setCameraParameters(PinholeCamera().toVisp());
    trunk->predict(cameraAt({0, 0, 1.2}).toVisp(), 320, 240);
    ASSERT_TRUE(trunk->border(Border::left).visible && trunk->border(Border::right).visible);
  }
  far.hideBehind(near); // its right border is behind the near trunk, its left one is not
  near.hideBehind(far);
  EXPECT_TRUE(far.border(Border::left).visible);
  EXPECT_FALSE(far.border(Border::right).visible);
  EXPECT_TRUE(near.border(Border::left).visible && near.border(Border::right).visible);
}

TEST(DistanceTrunk, KnowsABorderByItsProfile)
{
  const PinholeCamera camera;
  vpMbtDistanceTrunk trunk;
  trunk.buildFrom(test::uprightTrunk(4, 0.5, 0.15));
  trunk.setCameraParameters(camera.toVisp());
  // two trunks, side by side: the other's left border has the contrast of ours, but not its neighbourhood
  const std::vector<Cylinder> two = {test::uprightTrunk(4, 0.5, 0.15), test::uprightTrunk(4, 0.7, 0.02)};
  trunk.predict(cameraAt({0, 0, 1.2}).toVisp(), 320, 240);
  trunk.search(test::drawTrunks(camera, cameraAt({0, 0, 1.2}), two, 1), 3);
  EXPECT_EQ(trunk.border(Border::left).likeness(0), 0); // nothing remembered yet
  trunk.remember(0.2);
  const Pose moved = cameraAt({0, 0.04, 1.2}); // everything goes 2 px to the right in the image
  trunk.scan(test::drawTrunks(camera, moved, two, 2), 14);
  const auto &left = trunk.border(Border::left);
  const double own = std::max(left.likeness(-2), left.likeness(-1)); // whole pixels: it may lie between two
  EXPECT_GT(own, 0.85);
  int others = 0;
  for (const auto &peak : left.peaks)
    if (std::abs(peak.offset_px + 2) > 2) {
      ++others;
      EXPECT_LT(left.likeness(int(std::lround(peak.offset_px))), own - 0.2) << peak.offset_px;
    }
  EXPECT_GT(others, 0);
  EXPECT_EQ(left.likeness(1000), 0); // beyond the search
}

TEST(DistanceTrunk, RefusesWhatIsNoTrunk)
{
  vpMbtDistanceTrunk trunk;
  vpPoint p, q;
  p.setWorldCoordinates(1, 2, 3);
  q.setWorldCoordinates(1, 2, 4);
  EXPECT_THROW(trunk.buildFrom(p, p, 0.1), vpException);
  EXPECT_THROW(trunk.buildFrom(p, q, 0), vpException);
  EXPECT_THROW(trunk.buildFrom(p, q, std::nan("")), vpException);
  vpMbtDistanceTrunk::Options options;
  options.pieces = 0;
  EXPECT_THROW(vpMbtDistanceTrunk{options}, vpException);
}
} // namespace
