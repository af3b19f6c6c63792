// SPDX-License-Identifier: GPL-2.0-or-later
// What vpMbTrunkTracker says when the image is no image, when it is lost, and when one trunk is all there is.
#include "support/drawn_trunks.h"
#include "support/test.h"

#include <bole/vpMbTrunkTracker.h>
#include <visp3/core/vpTrackingException.h>

namespace
{
using namespace bole;
using test::cameraAt;
using Status = vpMbTrunkTracker::Status;

vpPoint pointAt(const Eigen::Vector3d &p)
{
  vpPoint point;
  point.setWorldCoordinates(p.x(), p.y(), p.z());
  return point;
}

struct Scene
{
  explicit Scene(const std::vector<Cylinder> &wood = test::smallWood()) : trunks(wood)
  {
    tracker.setCameraParameters(camera.toVisp());
    for (const Cylinder &trunk : trunks)
      tracker.addTrunk(pointAt(trunk.foot), pointAt(trunk.top), trunk.radius);
    tracker.initFromPose(image(0), pose(0).toVisp());
  }
  static Pose pose(int k) { return cameraAt({0.04 * k, 0.01 * k, 1.2}, 0.006 * k); }
  vpImage<unsigned char> image(int k) const { return test::drawTrunks(camera, pose(k), trunks, unsigned(k) + 1); }
  /// Whether track() complained.
  bool complains(const vpImage<unsigned char> &I)
  {
    try {
      tracker.track(I);
    }
    catch (const vpTrackingException &) {
      EXPECT_THROW(tracker.testTracking(), vpTrackingException);
      return true;
    }
    EXPECT_NO_THROW(tracker.testTracking());
    return false;
  }
  double metresOff(int k) const { return test::metresApart(Pose::fromVisp(tracker.getPose()), pose(k)); }

  PinholeCamera camera;
  std::vector<Cylinder> trunks;
  vpMbTrunkTracker tracker;
};

vpImage<unsigned char> noise(unsigned seed)
{
  vpImage<unsigned char> I(240, 320);
  std::mt19937 random(seed);
  for (unsigned i = 0; i < I.getSize(); ++i)
    I.bitmap[i] = static_cast<unsigned char>(random() & 255u);
  return I;
}

vpImage<unsigned char> smeared(vpImage<unsigned char> I)
{
  for (unsigned v = 120; v < 240; ++v)
    std::copy(I[119], I[119] + 320, I[v]);
  return I;
}

/// Follows the flight from frame \p k on; frames until three in a row are right and uncomplaining.
int framesToRecovery(Scene &scene, int k)
{
  int good = 0;
  for (int frame = 1; frame <= 12; ++frame, ++k) {
    good = !scene.complains(scene.image(k)) && scene.metresOff(k) < 0.1 ? good + 1 : 0;
    if (good == 3)
      return frame - 2;
  }
  return 99;
}

TEST(TrunkTrackerFaults, BlackNoiseFrozenSmearedAndWrongSizeImagesAreToldApart)
{
  const auto expectTold = [](const std::string &word, const auto &spoil) {
    Scene scene;
    EXPECT_FALSE(scene.complains(scene.image(1)));
    EXPECT_TRUE(scene.complains(spoil(scene))) << word;
    EXPECT_LT(scene.metresOff(2), 0.15) << word; // the prediction
    EXPECT_EQ(scene.tracker.getStatus(), Status::bad_image) << word;
    EXPECT_THAT(scene.tracker.getMessage(), testing::HasSubstr(word));
    EXPECT_LE(framesToRecovery(scene, 3), 5) << word;
  };
  expectTold("black", [](Scene &) { return vpImage<unsigned char>(240, 320, 0); });
  expectTold("noise", [](Scene &) { return noise(5); });
  expectTold("frozen", [](Scene &s) { return s.image(1); });
  expectTold("smeared", [](Scene &s) { return smeared(s.image(2)); });
  expectTold("size", [](Scene &) { return vpImage<unsigned char>(120, 160, 90); });
}

TEST(TrunkTrackerFaults, RecoversByItselfAfterFiveBlackFrames)
{
  Scene scene;
  for (int k = 1; k <= 4; ++k)
    ASSERT_FALSE(scene.complains(scene.image(k)));
  const vpMatrix before = scene.tracker.getPoseCovariance();
  for (int k = 5; k <= 9; ++k)
    ASSERT_TRUE(scene.complains(vpImage<unsigned char>(240, 320, 0)));
  EXPECT_GT(scene.tracker.getPoseCovariance()[2][2], 4 * before[2][2]); // it knows that it does not know
  EXPECT_LE(framesToRecovery(scene, 10), 5);
}

TEST(TrunkTrackerFaults, ThroughBlackFramesTheCameraGoesOnAtItsVelocity)
{
  Scene scene;
  const auto poseAt = [](int k) { return cameraAt({0.03 * k, 0.05 * k, 1.2}, 0.01 * k); };
  for (int k = 1; k <= 6; ++k)
    ASSERT_FALSE(scene.complains(test::drawTrunks(scene.camera, poseAt(k), scene.trunks, unsigned(k) + 1)));
  for (int k = 7; k <= 9; ++k)
    ASSERT_TRUE(scene.complains(vpImage<unsigned char>(240, 320, 0)));
  const Pose found = Pose::fromVisp(scene.tracker.getPose());
  EXPECT_LT(test::metresApart(found, poseAt(9)), 0.08);   // of 0.17 since the last good frame
  EXPECT_LT(test::radiansApart(found, poseAt(9)), 0.015); // of 0.03
}

TEST(TrunkTrackerFaults, AnotherPlaceIsLostAndNotTracked)
{
  Scene scene;
  ASSERT_FALSE(scene.complains(scene.image(1)));
  const std::vector<Cylinder> others = {test::uprightTrunk(3, -0.8, 0.3), test::uprightTrunk(6, 2.7, 0.12)};
  EXPECT_TRUE(scene.complains(test::drawTrunks(scene.camera, Scene::pose(2), others, 9)));
  EXPECT_EQ(scene.tracker.getStatus(), Status::lost);
}

TEST(TrunkTrackerFaults, WithoutAPriorFewAgreeingBordersAreNotVouchedFor)
{
  Scene scene;
  for (int k = 1; k < 6; ++k)
    EXPECT_FALSE(scene.complains(scene.image(k))) << k;
  const std::vector<Cylinder> left(scene.trunks.begin(), scene.trunks.begin() + 2); // three of five are gone
  bool has_complained = false;
  for (int k = 6; k < 10 && !has_complained; ++k)
    has_complained = scene.complains(test::drawTrunks(scene.camera, Scene::pose(k), left, unsigned(k) + 1));
  EXPECT_TRUE(has_complained);
}

TEST(TrunkTrackerFaults, AJumpThatThePriorExpectsIsFollowed)
{
  const Pose jumped = cameraAt({0.2, 0.75, 1.2}, 0.03);
  Scene scene;
  for (int k = 1; k <= 4; ++k)
    ASSERT_FALSE(scene.complains(scene.image(k)));
  vpMatrix covariance(6, 6);
  covariance.eye(6);
  covariance *= 4e-4;
  scene.tracker.setMotionPrior(jumped.toVisp(), covariance);
  EXPECT_FALSE(scene.complains(test::drawTrunks(scene.camera, jumped, scene.trunks, 9)));
  EXPECT_LT(test::metresApart(Pose::fromVisp(scene.tracker.getPose()), jumped), 0.05);
}

/// The true pose lies beyond the scan, and others fit part of the borders by chance.
TEST(TrunkTrackerFaults, AJumpWithoutAPriorIsSaidAtOnceAndTheFlightGoesOnWhereItEnds)
{
  for (const double aside : {-0.9, -0.75, -0.6, -0.45, 0.45, 0.6, 0.75, 0.9}) {
    Scene scene;
    for (int k = 1; k <= 4; ++k)
      ASSERT_FALSE(scene.complains(scene.image(k)));
    const Pose jumped = cameraAt({0.2, aside, 1.2}, 0.03);
    EXPECT_TRUE(scene.complains(test::drawTrunks(scene.camera, jumped, scene.trunks, 9))) << aside;
    EXPECT_EQ(scene.tracker.getStatus(), Status::lost) << aside;
    EXPECT_LE(framesToRecovery(scene, 6), 3) << aside;
  }
}

TEST(TrunkTrackerFaults, NoTrunkInViewIsSaid)
{
  Scene scene;
  const Pose away = cameraAt({0, 0, 1.2}, M_PI);
  scene.tracker.setPose(scene.image(1), away.toVisp());
  EXPECT_TRUE(scene.complains(scene.image(2)));
  EXPECT_EQ(scene.tracker.getStatus(), Status::no_trunk);
}

TEST(TrunkTrackerFaults, UprightTrunksLeaveTheHeightUnobserved)
{
  Scene scene;
  ASSERT_FALSE(scene.complains(scene.image(1)));
  EXPECT_EQ(scene.tracker.getStatus(), Status::partly_on_prior);
  const vpMatrix unobserved = scene.tracker.getUnobserved();
  ASSERT_EQ(unobserved.getCols(), 1u);
  EXPECT_GT(std::abs(unobserved[1][0]), 0.99); // y of a level camera is the height
}

TEST(TrunkTrackerFaults, WithOneTrunkTheHeightAndTheTurnAboutItStayOnThePrior)
{
  Scene scene({test::uprightTrunk(4, 0.2, 0.2)});
  vpMbTrunkTracker &tracker = scene.tracker;
  Vector6d about; // the camera circles the trunk and goes on facing it
  for (int k = 1; k <= 40; ++k) {
    vpMatrix covariance(6, 6);
    for (unsigned i = 0; i < 6; ++i)
      covariance[i][i] = i < 3 ? 0.02 * 0.02 : 0.01 * 0.01;
    tracker.setMotionPrior(Scene::pose(k % 20).toVisp(), covariance);
    ASSERT_FALSE(scene.complains(scene.image(k % 20)));
    EXPECT_LT(scene.metresOff(k % 20), 0.06);
  }
  EXPECT_EQ(tracker.getStatus(), Status::partly_on_prior);
  const vpMatrix U = tracker.getUnobserved();
  ASSERT_GE(U.getCols(), 2u);
  const Cylinder c = Pose::fromVisp(tracker.getPose()) * scene.trunks[0];
  const Eigen::Vector3d axis = c.axis(), foot = c.foot;
  Vector6d along;
  along << axis, Eigen::Vector3d::Zero();
  about << -axis.cross(foot), axis * tracker.getOptions().lever_m; // in m and rad * lever_m
  for (const Vector6d &direction : {along, about}) {
    Vector6d rest = direction.normalized();
    for (unsigned k = 0; k < U.getCols(); ++k) {
      double dot = 0;
      for (unsigned i = 0; i < 6; ++i)
        dot += U[i][k] * rest(int(i));
      for (unsigned i = 0; i < 6; ++i)
        rest(int(i)) -= dot * U[i][k];
    }
    EXPECT_LT(rest.norm(), 0.1); // it is within what is told as not observed
  }
  const vpMatrix covariance = tracker.getPoseCovariance();
  EXPECT_GT(std::sqrt(covariance[1][1]), 0.018); // the prior's own
}

TEST(TrunkTrackerFaults, WithOneTrunkAndNoPriorTheCovarianceGrowsAlongWhatIsNotSeenUntilThePoseIsCalledUncertain)
{
  Scene scene({test::uprightTrunk(4, 0.2, 0.2)});
  const double limit = scene.tracker.getOptions().max_sigma_m;
  bool was_believed = false, is_uncertain = false;
  double first = 0;
  for (int k = 1; k <= 30; ++k) { // the height alone is beyond the limit after 25 frames
    const bool has_complained = scene.complains(scene.image(k));
    const vpMatrix covariance = scene.tracker.getPoseCovariance();
    Eigen::Matrix3d P;
    for (unsigned i = 0; i < 3; ++i)
      for (unsigned j = 0; j < 3; ++j)
        P(int(i), int(j)) = covariance[i][j];
    const double sigma = std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(P).eigenvalues()(2));
    if (k == 1)
      first = covariance[1][1];
    if (sigma > limit) {
      EXPECT_TRUE(has_complained) << k;
    }
    EXPECT_EQ(scene.tracker.getStatus(), has_complained ? Status::uncertain : Status::partly_on_prior) << k;
    was_believed = was_believed || !has_complained;
    is_uncertain = has_complained;
  }
  EXPECT_TRUE(was_believed);
  EXPECT_TRUE(is_uncertain);
  EXPECT_GT(scene.tracker.getPoseCovariance()[1][1], 5 * first);
}
} // namespace
