// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/forest_flight.h"
#include "support/roc.h"
#include "support/test.h"
#include "synthetic.h"

#include "geometry/so3.h"
#include "saliency/saliency.h"

#include <algorithm>

using namespace bole;

namespace
{
using support::paint;
using support::WallAndPost;

const PinholeCamera kCamera{200, 200, 159.5, 119.5, 320, 240};
const Pose kStill;

TranslationPrior moved(const Eigen::Vector3d &pt, double sigma = 0.005)
{
  return {pt, Eigen::Matrix3d::Identity() * sigma * sigma};
}

RotationPrior turned(const Eigen::Matrix3d &pRc, double sigma = 1e-3)
{
  return {pRc, Eigen::Matrix3d::Identity() * sigma * sigma};
}

double errorDegrees(const Eigen::Matrix3d &A, const Eigen::Matrix3d &B)
{
  return logSo3(A.transpose() * B).norm() * 180 / M_PI;
}

void expectSound(const Saliency &saliency)
{
  ASSERT_EQ(saliency.p_background.getSize(), 320u * 240u);
  for (unsigned p = 0; p < saliency.p_background.getSize(); ++p) {
    ASSERT_GE(saliency.p_background.bitmap[p], 0.f); // false for NaN
    ASSERT_LE(saliency.p_background.bitmap[p], 1.f);
    ASSERT_TRUE(std::isfinite(saliency.confidence.bitmap[p]));
  }
  EXPECT_TRUE(saliency.pRc.allFinite());
  EXPECT_TRUE(saliency.covariance.allFinite());
}

/// Of the post and of the wall behind it, as they are seen from \p wMc.
std::pair<double, double> meanBackground(const Saliency &saliency, const WallAndPost &scene, const Pose &wMc)
{
  double post = 0, wall = 0, posts = 0, walls = 0;
  for (int v = 20; v < 220; ++v)
    for (int u = 20; u < 300; ++u) {
      const bool on = scene.onPost(wMc, u, v);
      (on ? post : wall) += saliency.p_background[v][u];
      ++(on ? posts : walls);
    }
  return {post / posts, wall / walls};
}

TEST(Saliency, FindsARenderedRotationWithoutGyro)
{
  const WallAndPost scene;
  const Eigen::Matrix3d turn = expSo3({0.01, -0.04, 0.02});
  SaliencyEstimator estimator(kCamera);
  estimator.update(scene.view(kStill));

  const Saliency saliency = estimator.update(scene.view(Pose(turn, {0, 0, 0})));

  EXPECT_LT(errorDegrees(turn, saliency.pRc), 0.03);
}

TEST(Saliency, LabelsAPatchThatMovesOtherwiseThanTheBackground)
{
  WallAndPost scene;
  scene.post_width = 0.6;
  const Eigen::Matrix3d turn = expSo3({0, 0.01, 0});
  SaliencyOptions options;
  options.sigma_background_px = 1; // the post's 4 px shall count as parallax
  options.sigma_foreground_px = 6;
  SaliencyEstimator estimator(kCamera, options);
  estimator.update(scene.view(kStill), turned(Eigen::Matrix3d::Identity()));
  const Pose now(turn, {0.06, 0, 0}); // the post moves by 4 px, the wall by 0.3

  const Saliency saliency = estimator.update(scene.view(now), turned(turn));

  const auto [post, wall] = meanBackground(saliency, scene, now);
  EXPECT_LT(post, 0.55);
  EXPECT_GT(wall, 0.75);
}

TEST(Saliency, LabelsANearPostByItsRangeWhereTheTranslationIsGiven)
{
  WallAndPost scene;
  scene.post_width = 0.6;
  SaliencyEstimator estimator(kCamera);
  Saliency saliency;
  Pose wMc;
  for (int frame = 0; frame < 6; ++frame) {
    const Eigen::Vector3d step(frame > 0 ? 0.08 : 0, 0, 0);
    wMc.t += step;
    saliency = estimator.update(scene.view(wMc), turned(Eigen::Matrix3d::Identity()), moved(step));
  }

  const auto [post, wall] = meanBackground(saliency, scene, wMc);
  EXPECT_LT(post, 0.1);
  EXPECT_GT(wall, 0.9);
}

TEST(Saliency, NeverLeavesZeroToOneOnExtremeImages)
{
  SaliencyEstimator estimator(kCamera);
  std::mt19937 random(3);
  const auto noise = [&](int, int) { return random() % 2 ? 1.0 : 0.0; };
  const auto black = [](int, int) { return 0.0; };
  const auto white = [](int, int) { return 1.0; };
  const auto checks = [](int u, int v) { return (u / 8 + v / 8) % 2 ? 1.0 : 0.0; };
  const auto inverted = [](int u, int v) { return (u / 8 + v / 8) % 2 ? 0.0 : 1.0; };
  for (const std::function<double(int, int)> &value :
       std::vector<std::function<double(int, int)>>{black, white, noise, noise, checks, inverted, black}) {
    const auto image = paint(kCamera, value);
    expectSound(estimator.update(image, turned(expSo3({0, 0.05, 0})), moved({0.1, 0, 0.2})));
  }
}

TEST(Saliency, KnowsNothingOfABlankImage)
{
  SaliencyEstimator estimator(kCamera);
  const Eigen::Matrix3d turn = expSo3({0, 0.02, 0});
  estimator.update(paint(kCamera, [](int, int) { return 0.5; }));

  const Saliency saliency =
      estimator.update(paint(kCamera, [](int, int) { return 0.51; }), turned(turn), moved({0.1, 0, 0}));

  EXPECT_LT(*std::max_element(saliency.confidence.bitmap, saliency.confidence.bitmap + saliency.confidence.getSize()),
            kUnknownBelow);
  EXPECT_LT(errorDegrees(turn, saliency.pRc), 1e-6);
}

TEST(Saliency, KeepsItsLabelsOnAFrozenFrameAndItsMotionForTheNext)
{
  const WallAndPost scene;
  SaliencyEstimator estimator(kCamera);
  const Eigen::Matrix3d turn = expSo3({0, 0.01, 0}), I = Eigen::Matrix3d::Identity();
  estimator.update(scene.view(kStill), turned(I), moved({0, 0, 0}));
  const auto image = scene.view(Pose(I, {0.05, 0, 0}));
  const Saliency before = estimator.update(image, turned(I), moved({0.05, 0, 0}));

  const Saliency frozen = estimator.update(image, turned(turn), moved({0.05, 0, 0}));
  const Saliency after = estimator.update(scene.view(Pose(turn * turn, {0.15, 0, 0})), turned(turn),
                                          moved(turn.transpose() * Eigen::Vector3d(0.05, 0, 0)));

  EXPECT_TRUE(std::equal(before.p_background.bitmap, before.p_background.bitmap + before.p_background.getSize(),
                         frozen.p_background.bitmap));
  EXPECT_LT(errorDegrees(turn * turn, after.pRc), 0.05);
}

TEST(Saliency, RefusesAnImageOfAnotherSize)
{
  SaliencyEstimator estimator(kCamera);
  EXPECT_THROW(estimator.update(vpImage<unsigned char>(10, 10)), vpException);
}

TEST(Saliency, TellsNearFromFarOnARenderedFlight)
{
  if (!support::hasFlight("park-forward"))
    GTEST_SKIP() << "the rendered flights are not here: " << BOLE_SHARED_DATA_DIR;
  const support::ForestFlight flight = support::readForestFlight("park-forward", 111);
  SaliencyOptions options;
  options.near_range = 6;
  SaliencyEstimator estimator(flight.camera, options);
  support::RocCurve roc;
  double worst_turn = 0;
  for (std::size_t i = 0; i < flight.size(); ++i) {
    const std::size_t before = i > 0 ? i - 1 : 0;
    const Eigen::Vector3d pt = (flight.wMc_odometry(before).inverse() * flight.wMc_odometry(i)).t;
    const Saliency saliency =
        estimator.update(flight.images[i], RotationPrior{flight.pRc_gyro[i], Eigen::Matrix3d::Identity() * 3.6e-7},
                         TranslationPrior{pt, Eigen::Matrix3d::Identity() * 2.9e-4});
    if (i < 10)
      continue;
    const Eigen::Matrix3d pRc = (flight.wMc_truth(before).inverse() * flight.wMc_truth(i)).R;
    worst_turn = std::max(worst_turn, logSo3(pRc.transpose() * saliency.pRc).norm());
    const auto mask = support::texturedAboveHorizon(flight.images[i], flight.camera, flight.wMc_truth(i).R);
    for (unsigned p = 0; p < mask.getSize(); ++p)
      if (mask.bitmap[p])
        roc.add(1 - saliency.p_background.bitmap[p], flight.depths_m[i].bitmap[p] < options.near_range);
  }
  EXPECT_GT(roc.area(), 0.88);
  EXPECT_LT(worst_turn, 0.003); // 0.17 degrees
}
} // namespace
