// SPDX-License-Identifier: GPL-2.0-or-later
// A program in the style of ViSP's model-based tutorials, once with ViSP's class and once with ours in its place.
#include "support/drawn_trunks.h"

#include "mbt/cao_reader.h"
#include <bole/vpMbTrunkTracker.h>

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iostream>
#include <unistd.h>
#include <visp3/core/vpDisplay.h>
#include <visp3/mbt/vpMbEdgeTracker.h>

namespace
{
using namespace bole;

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
    std::ofstream(m_name + ".xml") << "<?xml "
                                      "version=\"1.0\"?>\n<conf><ecm><mask><size>5</size><nb_mask>180</nb_mask></"
                                      "mask><range><tracking>8</tracking></range>"
                                      "<contrast><edge_threshold>5000</edge_threshold><mu1>0.5</mu1><mu2>0.5</mu2></"
                                      "contrast><sample><step>4</step></sample></ecm>"
                                      "<camera><u0>159.5</u0><v0>119.5</v0><px>200</px><py>200</py></camera>"
                                      "<face><angle_appear>85</angle_appear><angle_disappear>89</"
                                      "angle_disappear><near_clipping>0.1</near_clipping>"
                                      "<far_clipping>15</far_clipping><fov_clipping>1</fov_clipping></face></conf>\n";
    m_visp_says = std::cout.rdbuf(nullptr);
  }
  ~ViSPTutorial() override
  {
    std::cout.rdbuf(m_visp_says);
    std::filesystem::remove(m_name + ".cao");
    std::filesystem::remove(m_name + ".xml");
  }
  static void expectThere(const vpHomogeneousMatrix &cMo)
  {
    const Pose found = Pose::fromVisp(cMo);
    const Eigen::Vector3d off = found.inverse().t - truth(kFrames - 1).inverse().t;
    EXPECT_LT(off.head<2>().norm(), 0.06);
    EXPECT_LT(test::radiansApart(found, truth(kFrames - 1)), 0.02);
  }
  const std::string m_name = testing::TempDir() + "tutorial_" + std::to_string(::getpid());
  std::streambuf *m_visp_says;
};

TEST_F(ViSPTutorial, RunsWithViSPsEdgeTracker) { expectThere(runTutorial<vpMbEdgeTracker>(m_name)); }

TEST_F(ViSPTutorial, RunsUnchangedWithOurTrackerInItsPlace) { expectThere(runTutorial<vpMbTrunkTracker>(m_name)); }
} // namespace
