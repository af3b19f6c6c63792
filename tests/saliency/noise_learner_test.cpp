// SPDX-License-Identifier: GPL-2.0-or-later
#include "synthetic.h"

#include "saliency/noise_learner.h"
#include "saliency/roc.h"

#include <gtest/gtest.h>

namespace bole
{
namespace
{
TEST(SaliencyNoiseLearner, FindsTheNoiseAddedToAStillScene)
{
  const PinholeCamera camera{200, 200, 159.5, 119.5, 320, 240};
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 0.02);
  const auto noisy = [&](int u, int) { return (u < 160 ? 0.3 : 0.6) + noise(random); };
  SaliencyNoiseLearner learner(camera, {});
  Saliency saliency;
  saliency.status = SaliencyStatus::with_gyro;
  saliency.p_background.resize(240, 320);
  saliency.p_background = 1.f;
  saliency.confidence.resize(240, 320);
  saliency.confidence = 1.f;

  for (int pair = 0; pair < 10; ++pair)
    learner.add(support::paint(camera, noisy), support::paint(camera, noisy), saliency);

  EXPECT_NEAR(learner.learnt().sigma_intensity, 0.02, 0.006);
}

TEST(SaliencyNoiseLearner, KeepsWhatNoPixelSpokeOf)
{
  const SaliencyOptions start;
  const SaliencyNoiseLearner learner(PinholeCamera(), start);
  EXPECT_EQ(learner.learnt().sigma_foreground_px, start.sigma_foreground_px);
  EXPECT_EQ(learner.learnt().background_prior, start.background_prior);
}

TEST(RocCurve, IsOneForAPerfectScoreAndHalfForOneThatKnowsNothing)
{
  RocCurve perfect, opposite, ignorant;
  for (int i = 0; i < 100; ++i) {
    const bool positive = i % 3 == 0;
    perfect.add(positive ? 0.9f : 0.2f, positive);
    opposite.add(positive ? 0.2f : 0.9f, positive);
    ignorant.add(0.5f, positive);
  }
  EXPECT_NEAR(perfect.area(), 1, 1e-12);
  EXPECT_NEAR(opposite.area(), 0, 1e-12);
  EXPECT_NEAR(ignorant.area(), 0.5, 1e-12);
  EXPECT_TRUE(std::isnan(RocCurve().area()));
}
} // namespace
} // namespace bole
