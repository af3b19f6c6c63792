// SPDX-License-Identifier: GPL-2.0-or-later
// vpMbTrunkTracker as a vpMbTracker: every virtual that it overrides, called through the base class.
#include "support/drawn_trunks.h"
#include "support/test.h"

#include "mbt/model_files.h"
#include "mbt/model_trunk.h"
#include <bole/vpMbTrunkTracker.h>
#include <visp3/core/vpDisplay.h>
#include <visp3/core/vpTrackingException.h>
#include <visp3/mbt/vpMbEdgeTracker.h>

namespace
{
using namespace bole;
using test::cameraAt;

class MbTrunkTracker : public testing::Test
{
protected:
  MbTrunkTracker()
  {
    writeCao(m_cao, m_wood);
    m_tracker->setCameraParameters(m_camera.toVisp());
    m_tracker->loadModel(m_cao);
  }

  /// Where the camera is in frame \p k of a slow flight, and what it sees.
  static Pose pose(int k) { return cameraAt({0.05 * k, 0.02 * k, 1.2}, 0.01 * k); }
  vpImage<unsigned char> image(int k) const { return test::drawTrunks(m_camera, pose(k), m_wood, unsigned(k) + 1); }
  Pose found() const { return Pose::fromVisp(m_tracker->getPose()); }

  /// Right but for the height, which upright trunks do not tell.
  void expectAt(const Pose &truth, double metres = 0.05, double radians = 0.01) const
  {
    Eigen::Vector3d off = found().inverse().t - truth.inverse().t;
    EXPECT_LT(off.head<2>().norm(), metres);
    EXPECT_LT(test::radiansApart(found(), truth), radians);
  }

  const PinholeCamera m_camera;
  const std::vector<Cylinder> m_wood = test::smallWood();
  const test::TemporaryFolder m_folder;
  const std::string m_cao = m_folder / "wood.cao";
  std::unique_ptr<vpMbTracker> m_tracker = std::make_unique<vpMbTrunkTracker>();
};

TEST_F(MbTrunkTracker, TracksColourImagesAsItTracksGreyOnes)
{
  vpMbTrunkTracker grey;
  grey.setCameraParameters(m_camera.toVisp());
  grey.loadModel(m_cao);
  grey.initFromPose(image(0), pose(0).toVisp());
  m_tracker->initFromPose(test::inColour(image(0)), pose(0).toVisp());
  for (int k = 1; k <= 3; ++k) {
    grey.track(image(k));
    m_tracker->track(test::inColour(image(k)));
  }
  expectAt(pose(3));
  EXPECT_LT(test::metresApart(found(), Pose::fromVisp(grey.getPose())),
            0.02); // grey of a colour may differ by one level
}

TEST_F(MbTrunkTracker, StartsFromFourPoints)
{
  std::vector<vpPoint> points;
  std::vector<vpImagePoint> places;
  for (const Eigen::Vector3d &p : {Eigen::Vector3d(4, 1, 0.5), Eigen::Vector3d(5, -1, 0.4),
                                   Eigen::Vector3d(6, -0.5, 2.3), Eigen::Vector3d(4.5, 0.8, 2)}) {
    vpPoint point;
    point.setWorldCoordinates(p.x(), p.y(), p.z());
    const Eigen::Vector2d u = m_camera.project(pose(0) * p);
    points.push_back(point);
    places.emplace_back(u.y(), u.x());
  }
  m_tracker->initFromPoints(image(0), places, points);
  EXPECT_LT(test::metresApart(found(), pose(0)), 1e-3);
  m_tracker->track(image(1));
  expectAt(pose(1));
}

TEST_F(MbTrunkTracker, SetPoseMovesTheCameraForGreyAndColour)
{
  m_tracker->initFromPose(image(0), pose(0).toVisp());
  m_tracker->setPose(image(8), pose(8).toVisp());
  EXPECT_LT(test::metresApart(found(), pose(8)), 1e-9);
  m_tracker->track(image(9));
  expectAt(pose(9));
  m_tracker->setPose(test::inColour(image(3)), pose(3).toVisp());
  m_tracker->track(image(4));
  expectAt(pose(4));
}

TEST_F(MbTrunkTracker, ErrorsWeightsCovarianceAndFeaturesBelongToTheLastFrame)
{
  m_tracker->setCovarianceComputation(true);
  m_tracker->setProjectionErrorComputation(true);
  m_tracker->initFromPose(image(0), pose(0).toVisp());
  m_tracker->track(image(1));
  const vpColVector error = m_tracker->getError(), weights = m_tracker->getRobustWeights();
  ASSERT_GT(error.size(), 20u);
  ASSERT_EQ(error.size(), weights.size());
  for (unsigned i = 0; i < error.size(); ++i) {
    EXPECT_TRUE(weights[i] >= 0 && weights[i] <= 1);
    if (weights[i] > 0.9) {
      EXPECT_LT(std::abs(error[i]) * m_camera.fx, 2); // pixels
    }
  }
  const vpMatrix covariance = m_tracker->getCovarianceMatrix();
  ASSERT_EQ(covariance.getRows(), 6u);
  EXPECT_LT(std::sqrt(covariance[0][0]), 0.1);
  const double step = dynamic_cast<vpMbTrunkTracker &>(*m_tracker).getOptions().step_sigma_m;
  EXPECT_NEAR(std::sqrt(covariance[1][1]), std::hypot(0.01, step / 4),
              1e-3); // the height is not seen: as it was and one frame more
  const double right = m_tracker->getProjectionError();
  const double off =
      m_tracker->computeCurrentProjectionError(image(1), cameraAt({0, 0.4, 1.2}).toVisp(), m_camera.toVisp());
  EXPECT_LT(right, 25);
  EXPECT_GT(off, right + 10);
  const auto features = dynamic_cast<vpMbTrunkTracker &>(*m_tracker).getFeaturesForDisplay();
  EXPECT_EQ(features.size(), error.size());
  for (const auto &feature : features)
    EXPECT_TRUE(feature[1] >= 0 && feature[1] < 240 && feature[2] >= 0 && feature[2] < 320);
}

TEST_F(MbTrunkTracker, DrawsTheBordersWhereViSPDrawsTheLimbsOfACylinder)
{
  vpMbTracker &tracker = *m_tracker;
  tracker.initFromPose(image(0), pose(0).toVisp());
  const auto lines = tracker.getModelForDisplay(320, 240, pose(0).toVisp(), m_camera.toVisp());
  EXPECT_EQ(lines.size(), 10u);
  for (const auto &line : lines) {
    ASSERT_EQ(line.size(), 5u);
    double nearest = 1e9; // residual of both ends under the best border of the model
    for (const Cylinder &trunk : m_wood)
      for (const Border side : {Border::left, Border::right}) {
        const Cylinder c = pose(0) * trunk;
        const BorderPlane plane(c, relativeTrunk(c), side);
        nearest = std::min(nearest, std::max(std::abs(plane.residual(m_camera.ray({line[2], line[1]}))),
                                             std::abs(plane.residual(m_camera.ray({line[4], line[3]})))));
      }
    EXPECT_LT(nearest, 1e-6);
  }
  const vpImage<unsigned char> grey = image(0);
  const vpImage<vpRGBa> colour = test::inColour(grey);
  EXPECT_NO_THROW(tracker.display(grey, pose(0).toVisp(), m_camera.toVisp(), vpColor::red, 1));
  EXPECT_NO_THROW(tracker.display(colour, pose(0).toVisp(), m_camera.toVisp(), vpColor::red, 1, true));
}

TEST_F(MbTrunkTracker, OnlyTheEstimatedDegreesOfFreedomMove)
{
  vpColVector dof(6, 0.);
  dof[1] = 1; // along y of the object
  m_tracker->setEstimatedDoF(dof);
  m_tracker->initFromPose(image(0), pose(0).toVisp());
  m_tracker->setPose(image(0), cameraAt({0, 0.05, 1.2}).toVisp());
  const Pose before = found();
  m_tracker->track(image(0));
  const Eigen::Vector3d moved = before.R.transpose() * (found().t - before.t); // the model, in its own frame
  EXPECT_NEAR(moved.x(), 0, 1e-6);
  EXPECT_NEAR(moved.z(), 0, 1e-6);
  EXPECT_NEAR(moved.y(), 0.05, 0.02);
  EXPECT_LT(test::radiansApart(before, found()), 1e-6);
}

TEST_F(MbTrunkTracker, ResetForgetsTheModelAndReInitModelLoadsAnother)
{
  m_tracker->initFromPose(image(0), pose(0).toVisp());
  m_tracker->resetTracker();
  EXPECT_THROW(m_tracker->track(image(1)), vpException);
  EXPECT_THROW(m_tracker->initFromPose(image(0), pose(0).toVisp()), vpException); // no model
  auto &ours = dynamic_cast<vpMbTrunkTracker &>(*m_tracker);
  ours.reInitModel(image(2), m_cao, pose(2).toVisp());
  const auto lines = ours.getModelForDisplay(320, 240, pose(2).toVisp(), m_camera.toVisp());
  EXPECT_EQ(lines.size(), 2 * m_wood.size()); // no trunk twice
  m_tracker->track(image(3));
  expectAt(pose(3));
}

TEST_F(MbTrunkTracker, ReadsTheSettingsOfViSPAndItsOwn)
{
  const std::string xml =
      "<conf><ecm><mask><size>5</size></mask></ecm><camera><u0>160</u0><v0>120</v0><px>210</px><py>211</py></camera>"
      "<face><near_clipping>0.2</near_clipping><far_clipping>12</far_clipping></face>"
      "<trunk><scan_max_px>16</scan_max_px></trunk></conf>";
  m_tracker->loadConfigFile(m_folder.write("settings.xml", xml), false);
  vpCameraParameters cam;
  m_tracker->getCameraParameters(cam);
  EXPECT_EQ(cam.get_px(), 210);
  EXPECT_EQ(m_tracker->getNearClippingDistance(), 0.2);
  EXPECT_EQ(m_tracker->getFarClippingDistance(), 12);
  EXPECT_EQ(dynamic_cast<vpMbTrunkTracker &>(*m_tracker).getOptions().scan_max_px, 16);
}

TEST_F(MbTrunkTracker, FarClippingLeavesFarTrunksOut)
{
  m_tracker->initFromPose(image(0), pose(0).toVisp());
  m_tracker->track(image(1));
  const unsigned all = m_tracker->getError().size();
  m_tracker->setFarClippingDistance(6);
  m_tracker->setClipping(m_tracker->getClipping() | vpPolygon3D::FAR_CLIPPING);
  m_tracker->track(image(2));
  EXPECT_LT(m_tracker->getError().size(), all);
  EXPECT_GT(m_tracker->getError().size(), 0u);
}

TEST_F(MbTrunkTracker, RefusesAPriorThatIsNoCovarianceAndOptionsOutOfRange)
{
  auto &ours = dynamic_cast<vpMbTrunkTracker &>(*m_tracker);
  vpMatrix covariance(6, 6);
  EXPECT_THROW(ours.setMotionPrior(pose(0).toVisp(), covariance), vpException); // not positive definite
  EXPECT_THROW(ours.setMotionPrior(pose(0).toVisp(), vpMatrix(3, 3)), vpException);
  covariance.eye();
  covariance[2][2] = std::nan("");
  EXPECT_THROW(ours.setMotionPrior(pose(0).toVisp(), covariance), vpException);
  vpMbTrunkTracker::Options options;
  options.min_support = 2;
  EXPECT_REFUSED("min_support = 2, must be in [0.05, 1]", vpMbTrunkTracker tracker(options));
}

// A program in the style of ViSP's model-based tutorials, once with ViSP's class and once with ours in its place.

constexpr int kFrames = 12;
const std::vector<Cylinder> kWood = test::smallWood();
// nose up a little: ViSP 3.5 puts no moving edges on a limb that is exactly vertical in the image
Pose truth(int k) { return test::cameraAt({0.03 * k, 0.01 * k, 1.2}, 0.003 * k, 0.02); }
vpImage<unsigned char> grabbed(int k) { return test::drawTrunks(PinholeCamera(), truth(k), kWood, unsigned(k) + 1); }

/// The tutorial; nothing in it but the name of the class depends on the tracker.
template <class Tracker> vpHomogeneousMatrix runTutorial(const std::string &objectname)
{
  vpImage<unsigned char> I;
  vpCameraParameters cam;
  vpHomogeneousMatrix cMo;

  Tracker tracker;
  tracker.loadConfigFile(objectname + ".xml");
  tracker.setOgreVisibilityTest(false);
  tracker.loadModel(objectname + ".cao");
  tracker.setDisplayFeatures(true);
  tracker.setCovarianceComputation(true);
  I = grabbed(0);
  tracker.initFromPose(I, truth(0).toVisp());

  for (int k = 1; k < kFrames; ++k) {
    I = grabbed(k);
    vpDisplay::display(I);
    tracker.track(I);
    tracker.getPose(cMo);
    tracker.getCameraParameters(cam);
    tracker.display(I, cMo, cam, vpColor::red, 2);
    vpDisplay::displayFrame(I, cMo, cam, 0.025, vpColor::none, 3);
    vpDisplay::flush(I);
    EXPECT_EQ(tracker.getCovarianceMatrix().getRows(), 6u);
  }
  return cMo;
}

class ViSPTutorial : public testing::Test
{
protected:
  ViSPTutorial()
  {
    writeCao(m_name + ".cao", kWood);
    m_folder.write(
        "tutorial.xml",
        "<?xml version=\"1.0\"?>\n<conf><ecm><mask><size>5</size><nb_mask>180</nb_mask></mask>"
        "<range><tracking>8</tracking></range><contrast><edge_threshold>5000</edge_threshold><mu1>0.5</mu1>"
        "<mu2>0.5</mu2></contrast><sample><step>4</step></sample></ecm>"
        "<camera><u0>159.5</u0><v0>119.5</v0><px>200</px><py>200</py></camera>"
        "<face><angle_appear>85</angle_appear><angle_disappear>89</angle_disappear>"
        "<near_clipping>0.1</near_clipping><far_clipping>15</far_clipping><fov_clipping>1</fov_clipping></face>"
        "</conf>\n");
    m_visp_says = std::cout.rdbuf(nullptr);
  }
  ~ViSPTutorial() override { std::cout.rdbuf(m_visp_says); }
  static void expectThere(const vpHomogeneousMatrix &cMo)
  {
    const Pose found = Pose::fromVisp(cMo);
    const Eigen::Vector3d off = found.inverse().t - truth(kFrames - 1).inverse().t;
    EXPECT_LT(off.head<2>().norm(), 0.06);
    EXPECT_LT(test::radiansApart(found, truth(kFrames - 1)), 0.02);
  }
  const test::TemporaryFolder m_folder;
  const std::string m_name = m_folder / "tutorial";
  std::streambuf *m_visp_says;
};

TEST_F(ViSPTutorial, RunsWithViSPsEdgeTracker) { expectThere(runTutorial<vpMbEdgeTracker>(m_name)); }

TEST_F(ViSPTutorial, RunsUnchangedWithOurTrackerInItsPlace) { expectThere(runTutorial<vpMbTrunkTracker>(m_name)); }
} // namespace
