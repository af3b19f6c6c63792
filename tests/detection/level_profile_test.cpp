// SPDX-License-Identifier: GPL-2.0-or-later
#include "drawn_trunks.h"

#include <gtest/gtest.h>

namespace
{
using namespace bole;
using namespace bole::test;

const PinholeCamera kCamera;

LevelProfile profileOf(const std::vector<DrawnTrunk> &trunks, const Pose &wMc)
{
  return computeLevelProfile(computeGradient(draw(trunks, wMc, kCamera)).signed_x, kCamera, wMc.R, {});
}

/// tan of the bearing from the heading of \p wMc of the left or right border of a trunk.
double borderColumn(const DrawnTrunk &trunk, const Pose &wMc, bool is_left)
{
  const Eigen::Vector2d forward = wMc.R.col(2).head<2>().normalized(), w = trunkOf(trunk).xy - wMc.t.head<2>();
  const double bearing = std::atan2(forward.x() * w.y() - forward.y() * w.x(), forward.dot(w));
  return std::tan(bearing + (is_left ? 1 : -1) * std::asin(trunk.radius / w.norm()));
}

/// The nearest peak to a column, in pixels of the camera.
double distance_px(const LevelProfile &profile, double q, double *contrast = nullptr)
{
  double nearest = 1e9;
  for (const ProfilePeak &peak : profile.peaks)
    if (std::abs(peak.q - q) < nearest) {
      nearest = std::abs(peak.q - q);
      if (contrast)
        *contrast = peak.contrast;
    }
  return nearest * kCamera.fx;
}

TEST(LevelProfile, PeaksStandAtTheBordersWhateverTheAttitude)
{
  const std::vector<DrawnTrunk> trunks = {{4, 0.6, 0.2, 40}, {6, -1.5, 0.15, 90}};
  for (const Pose &wMc :
       {lookingAhead(0, 0), lookingAhead(0.3, -0.2, 0.15, 0.1, -0.2), lookingAhead(0, 0.2, -0.1, -0.12, 0.3)}) {
    const LevelProfile profile = profileOf(trunks, wMc);
    for (const DrawnTrunk &trunk : trunks)
      for (const bool is_left : {true, false}) {
        double contrast = 0;
        EXPECT_LT(distance_px(profile, borderColumn(trunk, wMc, is_left), &contrast), 0.25);
        EXPECT_LT(is_left ? contrast : -contrast, -0.05); // bright to dark on the left, dark to bright on the right
      }
    EXPECT_EQ(profile.peaks.size(), 4u);
  }
}

TEST(LevelProfile, LinesThatLeanAsTheTrunkDoesSeeItsBordersWhole)
{
  const DrawnTrunk trunk{4, 0.5, 0.15, 40, 0.06};
  const Pose wMc = lookingAhead(0.3, -0.2, 0.15, 0.1, -0.2);
  const vpImage<float> gradient = computeGradient(draw({trunk}, wMc, kCamera)).signed_x;
  DrawnTrunk at_camera = trunk;
  at_camera.y += 1.2 * trunk.lean;
  at_camera.lean = 0;
  ProfileOptions leaning;
  leaning.lean = trunk.lean;
  const LevelProfile upright_lines = computeLevelProfile(gradient, kCamera, wMc.R, {});
  const LevelProfile leaning_lines = computeLevelProfile(gradient, kCamera, wMc.R, leaning);
  for (const bool is_left : {true, false}) {
    const double q = borderColumn(at_camera, wMc, is_left);
    double smeared = 0, whole = 0;
    distance_px(upright_lines, q, &smeared);
    EXPECT_LT(distance_px(leaning_lines, q, &whole), 0.5);
    EXPECT_GT(std::abs(whole), 1.5 * std::abs(smeared));
  }
}

TEST(LevelProfile, ABrightTrunkHasTheOtherPolarity)
{
  const DrawnTrunk trunk{4, 0.3, 0.2, 250};
  const Pose wMc = lookingAhead(0, 0);
  vpImage<unsigned char> image = draw({trunk}, wMc, kCamera, 90);
  const LevelProfile profile = computeLevelProfile(computeGradient(image).signed_x, kCamera, wMc.R, {});
  double contrast = 0;
  EXPECT_LT(distance_px(profile, borderColumn(trunk, wMc, true), &contrast), 0.25);
  EXPECT_GT(contrast, 0.05);
}

TEST(LevelProfile, LevelFrameIsUprightAndHeadsWhereTheCameraDoes)
{
  const Pose wMc = lookingAhead(0, 0, 0.4, 0.1, -0.2);
  const LevelProfile profile = profileOf({}, wMc);
  const Eigen::Matrix3d wRl = wMc.R * profile.cRl;
  EXPECT_LT((wRl.col(2) - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
  EXPECT_LT((wRl.col(0).head<2>() - wMc.R.col(2).head<2>().normalized()).norm(), 1e-12);
}

TEST(LevelProfile, SortsItsPeaksFromRightToLeft)
{
  const LevelProfile profile = profileOf({{4, 1.2, 0.2, 40}, {4, 0.2, 0.2, 70}, {5, -1, 0.2, 60}}, lookingAhead(0, 0));
  for (std::size_t i = 1; i < profile.peaks.size(); ++i)
    EXPECT_LT(profile.peaks[i - 1].q, profile.peaks[i].q);
}

TEST(LevelProfile, KeepsRisingAndFallingBordersApart)
{
  const DrawnTrunk trunk{4, 0.3, 0.2, 40};
  const Pose wMc = lookingAhead(0, 0);
  const LevelProfile profile = profileOf({trunk}, wMc);
  const double q = borderColumn(trunk, wMc, true);
  const auto sample = static_cast<std::size_t>((q - profile.q_first) / profile.step + 0.5);
  EXPECT_LT(profile.falling[sample], -0.1);
  EXPECT_LT(profile.rising[sample], 0.01);
  EXPECT_TRUE(profile.covers(q));
  EXPECT_FALSE(profile.covers(10));
}

TEST(LevelProfile, OfABlankImageHasNoPeaks) { EXPECT_TRUE(profileOf({}, lookingAhead(0, 0)).peaks.empty()); }
} // namespace
