// SPDX-License-Identifier: GPL-2.0-or-later
// How a detection becomes a candidate: followed through the window, fitted to what was seen.
#include "support/drawn_trunks.h"
#include "support/test.h"

#include "pipeline/candidate_track.h"

using namespace bole;

namespace
{
const PinholeCamera kCamera;
const Pose kMount = SmootherOptions::forwardCamera();
constexpr int kFrames = 10;

/// A camera that has moved sideways before the small wood, known poses, nothing in the map.
class Adopting : public testing::Test
{
protected:
  void SetUp() override
  {
    m_options.smoothing.bMc = kMount;
    m_smoother = Smoother(m_options.smoothing);
    for (int k = 0; k < kFrames; ++k) {
      const Pose wMb(Eigen::Matrix3d::Identity(), {0, 0.08 * k, 1.2});
      const Pose step(Eigen::Matrix3d::Identity(), {0, 0.08, 0});
      const Matrix6d covariance = 1e-8 * Matrix6d::Identity();
      const std::size_t pose = k == 0 ? m_smoother.addFirstPose(wMb, covariance) : m_smoother.addPose(step, covariance);
      m_smoother.update();
      m_view.wMc = wMb * kMount;
      m_view.ground = GroundPlane();
      m_view.time_s = 0.1 * k;
      const auto image = test::drawTrunks(kCamera, m_view.wMc.inverse(), test::smallWood(), unsigned(k));
      m_window.push(std::make_shared<const Gradient>(computeGradient(image)), pose, m_view, m_smoother, m_options);
    }
  }
  /// The first trunk of the wood, as a detector might have it.
  static Detection detected(double x_error, double radius)
  {
    Detection detection;
    detection.trunk = {{4 + x_error, 1.6 * (4 + x_error) / 4}, std::log(radius)};
    return detection;
  }
  CandidateTrack follow(const Detection &detection) const
  {
    return trackThroughWindow(detection, m_window, m_smoother, m_map, m_view, m_options);
  }

  StageOptions m_options;
  Smoother m_smoother;
  TrunkMap m_map;
  DetectionWindow m_window;
  Viewpoint m_view;
};

TEST_F(Adopting, EveryViewOfTheWindowThatShowsTheTrunkIsTakenIn)
{
  const CandidateTrack track = follow(detected(0.02, 0.15));
  EXPECT_EQ(track.views.size(), static_cast<std::size_t>(kFrames));
  EXPECT_EQ(track.trunk.views.size(), track.views.size());
  EXPECT_LT(track.trunk.innovation2, 0.5);
}

TEST_F(Adopting, TheTrunkIsFittedToItsViews)
{
  const CandidateTrack track = follow(detected(0.1, 0.154));
  EXPECT_NEAR(track.trunk.trunk.xy.x(), 4, 0.04);
  EXPECT_NEAR(track.trunk.trunk.xy.y(), 1.6, 0.02);
  EXPECT_NEAR(track.trunk.trunk.radius(), 0.15, 0.005);
}

TEST_F(Adopting, WhereNothingStandsNothingIsSeen)
{
  Detection nothing = detected(0, 0.15);
  nothing.trunk.xy = {4, 0.9};
  const CandidateTrack track = follow(nothing);
  EXPECT_TRUE(track.views.empty());
  EXPECT_EQ(track.trunk.innovation2, 9); // the worst there is
}

TEST_F(Adopting, ViewsBehindANearerTrunkOfTheMapAreLeftOut)
{
  MapTrunk curtain;
  curtain.trunk = {{2, 0.8}, std::log(0.3)};
  curtain.status = TrunkStatus::confirmed;
  m_map = TrunkMap(MapOptions(), {curtain});
  EXPECT_LT(follow(detected(0.02, 0.15)).views.size(), static_cast<std::size_t>(kFrames));
}

TEST_F(Adopting, ViewsFromOnePlaceCountForOne)
{
  m_options.flow.view_correlation = 0.16; // twice the way between two views
  const CandidateTrack track = follow(detected(0.02, 0.15));
  const CandidateTrack all = [&] {
    m_options.flow.view_correlation = 0;
    return follow(detected(0.02, 0.15));
  }();
  EXPECT_EQ(track.views[0].summary.F, all.views[0].summary.F);
  EXPECT_LT((track.views[1].summary.F - 0.5 * all.views[1].summary.F).norm(), 1e-6 * all.views[1].summary.F.norm());
}

TEST(DetectionWindow, KeepsViewsFromPlacesApartAndAlwaysTheNewest)
{
  StageOptions options;
  options.smoothing.bMc = kMount;
  options.flow.view_spacing = 0.1;
  options.detection.window = 4;
  Smoother smoother(options.smoothing);
  DetectionWindow window;
  Viewpoint view;
  for (std::size_t k = 0; k < 12; ++k) {
    const Matrix6d covariance = 1e-8 * Matrix6d::Identity();
    const Pose step(Eigen::Matrix3d::Identity(), {0, 0.06, 0});
    k == 0 ? smoother.addFirstPose(Pose(), covariance) : smoother.addPose(step, covariance);
    smoother.update();
    view.wMc = smoother.pose(k) * kMount;
    window.push(std::make_shared<const Gradient>(computeGradient(vpImage<unsigned char>(240, 320, 128))), k, view,
                smoother, options);
    EXPECT_EQ(window.newest().pose, k);
  }
  ASSERT_EQ(window.views().size(), 4u);
  for (std::size_t i = 1; i + 1 < window.views().size(); ++i)
    EXPECT_GE(window.views()[i].pose - window.views()[i - 1].pose, 2u);
}
} // namespace

/// A guess as thin as a twig where views show a thick trunk: one full step would make it wider than the wood.
TEST(FitTrunk, ChangesNoRadiusBeyondAllReason)
{
  SmootherOptions options;
  options.bMc = kMount;
  const Trunk thick{{4, 0}, std::log(2.0)}, guess{{4, 0}, std::log(0.02)};
  std::vector<TrackedView> views;
  for (int k = 0; k < kFrames; ++k) {
    const Pose wMb(Eigen::Matrix3d::Identity(), {0, 0.08 * k, 1.2});
    views.push_back({static_cast<std::size_t>(k),
                     wMb,
                     {relativeTrunk(wMb, kMount, thick), 0, Vector4d::Zero(), 1e4 * Matrix4d::Identity()}});
  }
  const Trunk fitted = fitTrunk(guess, views, options);
  EXPECT_LT(fitted.radius(), 4);
  EXPECT_GT(fitted.radius(), guess.radius());
}
