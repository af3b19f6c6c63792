// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "geometry/so3.h"
#include "summary/square_root.h"
#include "tracking/trunk_tracker.h"
#include <bole/open_source.h>

namespace
{
using namespace bole;

RelativeTrunk seen(double roll = 0)
{
  const Trunk trunk{{4, 0.4}, std::log(0.2)};
  return relativeTrunk(Pose(forwardCamera().R * expSo3({0, 0, roll}), {0, 0, 1.2}), Pose(), trunk);
}

/// The trunk as a flat area of grey \p inside between \p left and \p right ones, its borders smooth over a pixel.
vpImage<unsigned char> drawn(const PinholeCamera &camera, const RelativeTrunk &trunk, int inside, int left, int right)
{
  vpImage<unsigned char> image(240, 320);
  for (int v = 0; v < 240; ++v)
    for (int u = 0; u < 320; ++u) {
      const auto within = [&](Border border) { // from 0 to 1
        return std::clamp(0.5 - camera.fx * trunk.borderNormal(border).dot(camera.ray(Eigen::Vector2d(u, v))), 0., 1.);
      };
      image[v][u] = static_cast<unsigned char>(
          std::lround(left + (inside - left) * within(Border::left) + (right - inside) * (1 - within(Border::right))));
    }
  return image;
}

vpImage<unsigned char> drawn(const PinholeCamera &camera, const RelativeTrunk &trunk, int inside, int outside)
{
  return drawn(camera, trunk, inside, outside, outside);
}

TrackingPrediction predictionNear(const RelativeTrunk &truth, const Vector4d &error)
{
  TrackingPrediction prediction;
  prediction.relative = truth.plus(error);
  prediction.covariance.diagonal() << 1e-4, 1e-4, 4e-4, 1e-2;
  return prediction;
}

void expectFound(const vpImage<unsigned char> &image, const RelativeTrunk &truth)
{
  const PinholeCamera camera;
  const TrackingResult result =
      trackTrunk(computeGradient(image), camera, predictionNear(truth, {0.005, 0, 0.015, 0.05}), TrackingOptions());
  ASSERT_EQ(result.status, TrackingStatus::tracked) << toString(result.status);
  const Vector4d error = result.optimum.minus(truth);
  EXPECT_LT(std::abs(error(2)) * camera.fx, 0.15); // bearing [px]
  EXPECT_LT(std::abs(error(3)), 0.02);             // r/d
  EXPECT_GT(result.F.trace(), 1);
  EXPECT_LT((result.F - result.F.transpose()).norm(), 1e-9 * result.F.norm());
}

TEST(TrunkTracker, FindsADarkTrunk) { expectFound(drawn(PinholeCamera(), seen(), 40, 200), seen()); }
TEST(TrunkTracker, FindsABrightTrunk) { expectFound(drawn(PinholeCamera(), seen(), 220, 90), seen()); }
TEST(TrunkTracker, FindsATrunkUnderRoll) { expectFound(drawn(PinholeCamera(), seen(0.25), 40, 200), seen(0.25)); }

/// A prediction that leans, tips and is too thin: each has to be mended by the polish, in steps of about a pixel.
TEST(TrunkTracker, MendsTiltAndWidthOfThePredictionTogether)
{
  const PinholeCamera camera;
  TrackingPrediction prediction = predictionNear(seen(), {0.02, 0.02, 0.02, -0.2});
  prediction.covariance.diagonal() << 1e-3, 1e-3, 4e-4, 1e-2;
  const TrackingResult result =
      trackTrunk(computeGradient(drawn(camera, seen(), 40, 200)), camera, prediction, TrackingOptions());
  ASSERT_EQ(result.status, TrackingStatus::tracked) << toString(result.status);
  const Vector4d error = result.optimum.minus(seen());
  EXPECT_LT(std::abs(error(0)), 0.01);                              // a lean of 0.02 in the prediction
  EXPECT_LT(std::abs(error(2)) * camera.fx, 0.25);                  // bearing [px]; 0.5 with the prediction's lean
  EXPECT_LT(std::abs(error(3)) * seen().ratio() * camera.fx, 0.08); // half the width [px]
}

/// As where the drone passes a trunk: the other border is out of the picture or behind another trunk.
TEST(TrunkTracker, LeavesALineOnTheBarkOnlyWhereTheOtherBorderIsRead)
{
  const Gradient gradient = computeGradient(drawn(PinholeCamera(), seen(), 40, 200));
  TrackingPrediction prediction = predictionNear(seen(), Vector4d::Zero());
  prediction.left_on_bark = true;
  const TrackingResult both = trackTrunk(gradient, PinholeCamera(), prediction, TrackingOptions());
  EXPECT_EQ(both.status, TrackingStatus::tracked);
  EXPECT_FALSE(both.left_used);
  EXPECT_TRUE(both.right_used);
  prediction.right_hidden = true;
  const TrackingResult alone = trackTrunk(gradient, PinholeCamera(), prediction, TrackingOptions());
  EXPECT_EQ(alone.status, TrackingStatus::tracked);
  EXPECT_TRUE(alone.left_used);
}

/// Six pixels beside the prediction, as far as a gust turns the drone.
TEST(TrunkTracker, FollowsByOneBorderWhereTheOtherIsHidden)
{
  const PinholeCamera camera;
  const Gradient gradient = computeGradient(drawn(camera, seen(), 40, 200));
  for (const double off : {-0.03, 0.03})
    for (const bool is_left_hidden : {true, false}) {
      TrackingPrediction prediction = predictionNear(seen(), Vector4d(0, 0, off, 0));
      (is_left_hidden ? prediction.left_hidden : prediction.right_hidden) = true;
      const TrackingResult result = trackTrunk(gradient, camera, prediction, TrackingOptions());
      ASSERT_EQ(result.status, TrackingStatus::tracked) << toString(result.status);
      EXPECT_EQ(result.left_used, !is_left_hidden);
      EXPECT_EQ(result.right_used, is_left_hidden);
      EXPECT_LT(std::abs(result.optimum.minus(seen())(2)) * camera.fx, 1) << off << ' ' << is_left_hidden;
    }
}

/// The sun comes round a dark trunk: its left border turns bright, and the contrast that it had stands at the inner end
/// of a rim of light.
TEST(TrunkTracker, KeepsTheKnownWidthWhereARimOfSunGrows)
{
  constexpr double kRim_px = 2;
  const PinholeCamera camera;
  const double ratio_px = seen().ratio() * camera.fx; // half the width
  const RelativeTrunk shade = seen().plus({0, 0, -0.5 * kRim_px / camera.fx, -0.5 * kRim_px / ratio_px});
  vpImage<unsigned char> image = drawn(camera, seen(), 200, 110), inner = drawn(camera, shade, 0, 160);
  for (unsigned i = 0; i < image.getSize(); ++i)
    image.bitmap[i] = static_cast<unsigned char>(image.bitmap[i] - 160 + inner.bitmap[i]);
  TrackingPrediction prediction = predictionNear(seen(), Vector4d::Zero());
  prediction.covariance.diagonal() << 1e-4, 1e-4, 1e-4, 1e-4; // two pixels sideways, a hundredth of its width
  prediction.left_contrast = -0.2;
  prediction.right_contrast = 0.1;
  const auto moved_px = [&](const TrackingResult &result) { // of the left border
    const Vector4d error = result.optimum.minus(seen());
    return camera.fx * error(2) + ratio_px * error(3);
  };
  TrackingOptions options;
  const TrackingResult alone = trackTrunk(computeGradient(image), camera, prediction, options);
  EXPECT_EQ(alone.status, TrackingStatus::tracked);
  EXPECT_LT(moved_px(alone), -1.5); // at the end of the rim
  options.border_correlation = 0.8;
  const TrackingResult together = trackTrunk(computeGradient(image), camera, prediction, options);
  EXPECT_EQ(together.status, TrackingStatus::sign_changed);
  EXPECT_LT(std::abs(moved_px(together)), 0.6);
}

TEST(TrunkTracker, TellsOfABlankImageOfTheOtherPolarityAndOfNaN)
{
  const auto statusOf = [](const vpImage<unsigned char> &image, const TrackingPrediction &prediction) {
    return trackTrunk(computeGradient(image), PinholeCamera(), prediction, TrackingOptions()).status;
  };
  TrackingPrediction prediction = predictionNear(seen(), Vector4d::Zero());
  EXPECT_EQ(statusOf(vpImage<unsigned char>(240, 320, 0), prediction), TrackingStatus::no_border);
  prediction.left_contrast = -0.2;
  prediction.right_contrast = 0.2;
  EXPECT_EQ(statusOf(drawn(PinholeCamera(), seen(), 220, 90), prediction), TrackingStatus::sign_changed);
  prediction.relative.log_ratio = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(statusOf(drawn(PinholeCamera(), seen(), 40, 200), prediction), TrackingStatus::not_visible);
}

/// A gradient image that is a smooth wave across and along the columns: its interpolation is smooth as well.
Gradient wave()
{
  Gradient gradient;
  gradient.signed_x.resize(240, 320);
  for (int v = 0; v < 240; ++v)
    for (int u = 0; u < 320; ++u)
      gradient.signed_x[v][u] = static_cast<float>(0.1 * std::sin(0.05 * u + 0.01 * v));
  return gradient;
}

TEST(TrunkEnergy, GradientAgreesWithCentralDifferencesAtTwoStepSizes)
{
  const PinholeCamera camera;
  const Gradient gradient = wave();
  const ElevationRange whole_image{-2, 2}; // the rows do not change with the trunk
  const TrunkEnergy energy(gradient, camera, whole_image, {true, 0.1}, {true, 0.1}, EnergyOptions());
  const RelativeTrunk at = seen(0.1).plus({0.003, 0.01, 0.006, 0.04});
  Vector4d f;
  energy.evaluate(at, &f);
  // about 4 px of border for the wide step and 2 px for the narrow one, of a wave of 126 px; the second component tips
  // the trunk away from the camera, which hardly moves its borders
  const Vector4d wide(0.04, 0.4, 0.02, 0.4);
  for (int i = 0; i < 4; ++i) {
    const auto errorAt = [&](double h) {
      const Vector4d step = h * Vector4d::Unit(i);
      return (energy.evaluate(at.plus(step)) - energy.evaluate(at.plus(-step))) / (2 * h) - f(i);
    };
    const double far = errorAt(wide(i)), near = errorAt(0.5 * wide(i));
    EXPECT_NEAR(far / near, 4, 0.5) << "parameter " << i;
    EXPECT_LT(std::abs(near), 0.03 * std::abs(f(i))) << "parameter " << i;
  }
}

/// Where the gradient grows to both sides of a border, a sideways move of the border only makes it better.
TEST(TrunkEnergy, SaysThatABorderStandsWhereTheImageIsWorst)
{
  const PinholeCamera camera;
  const RelativeTrunk at = seen();
  const auto curvatureOf = [&](double bend) {
    Gradient gradient;
    gradient.signed_x.resize(240, 320);
    const double u_left = borderLine(camera, at, Border::left, {}).x_top; // upright: one column
    for (int v = 0; v < 240; ++v)
      for (int u = 0; u < 320; ++u)
        gradient.signed_x[v][u] = static_cast<float>(0.1 + bend * (u - u_left) * (u - u_left));
    return TrunkEnergy(gradient, camera, {}, {true, 0.1}, {false, 0.1}, EnergyOptions()).curvature(at);
  };
  const auto worst = curvatureOf(1e-4), best = curvatureOf(-1e-4);
  EXPECT_TRUE(worst.negative);
  EXPECT_LT(worst.F.norm(), 1e-3 * best.F.norm()); // what is not convex is left out
  EXPECT_FALSE(best.negative);
}

TEST(TrunkEnergy, BrightnessScalesNothing)
{
  const PinholeCamera camera;
  const RelativeTrunk at = seen();
  const auto curvatureOf = [&](int inside, int outside) {
    const Gradient gradient = computeGradient(drawn(camera, seen(), inside, outside));
    TrunkEnergy probe(gradient, camera, {}, {}, {}, EnergyOptions());
    const double c = std::abs(probe.contrastAt(at, Border::left)), d = std::abs(probe.contrastAt(at, Border::right));
    return TrunkEnergy(gradient, camera, {}, {true, c}, {true, d}, EnergyOptions()).curvature(at);
  };
  const auto weak = curvatureOf(100, 150), strong = curvatureOf(50, 250);
  EXPECT_FALSE(weak.negative);
  EXPECT_LT((weak.F - strong.F).norm(), 0.03 * strong.F.norm());
}

/// What the summary factor stands for: the image energy round its optimum.
TEST(SummaryOfAnImage, FollowsTheImageEnergyOnAGridRoundItsOptimum)
{
  const PinholeCamera camera;
  const RelativeTrunk truth = seen();
  const Gradient gradient = computeGradient(drawn(camera, truth, 100, 210, 40));
  TrackingPrediction prediction;
  prediction.relative = truth.plus({0.004, 0, 0.008, 0.03});
  const TrackingOptions options;
  const TrackingResult tracked = trackTrunk(gradient, camera, prediction, options);
  ASSERT_EQ(tracked.status, TrackingStatus::tracked) << toString(tracked.status);
  const SummaryFactor summary{tracked.optimum, tracked.energy, tracked.f, tracked.F};
  SquareRootSummary root;
  ASSERT_EQ(squareRoot(summary, root), SummaryStatus::ok);
  const TrunkEnergy image(gradient, camera, prediction.range, {true, std::abs(tracked.left_contrast)},
                          {true, std::abs(tracked.right_contrast)}, options.energy);
  const double here = image.evaluate(tracked.optimum);

  // steps that move a border, or one of its ends, by about 0.4 px
  const double turn = 0.4 / 50, bearing = 0.4 / camera.fx, widen = 0.4 / (camera.fx * truth.ratio());
  int looked = 0;
  for (int i = -2; i <= 2; ++i)
    for (int j = -2; j <= 2; ++j)
      for (int k = -2; k <= 2; ++k) {
        if (std::abs(i) + std::abs(j) + std::abs(k) == 0 || std::abs(i) + std::abs(j) + std::abs(k) > 3)
          continue;
        const RelativeTrunk at = tracked.optimum.plus({i * turn, 0, j * bearing, k * widen});
        const double rise = image.evaluate(at) - here;
        EXPECT_GT(rise, 0) << i << j << k; // the optimum is one
        EXPECT_NEAR((summary.energyAt(at) - summary.energy) / rise, 1, 0.35) << i << " " << j << " " << k;
        EXPECT_NEAR(0.5 * root.residual(at).squaredNorm() + root.constant, summary.energyAt(at), 1e-9);
        ++looked;
      }
  EXPECT_GT(looked, 50);
}

TEST(SummaryOfAnImage, KnowsThePlaceOfABorderToWhatAlphaSays)
{
  const PinholeCamera camera;
  const RelativeTrunk truth = seen();
  const Gradient gradient = computeGradient(drawn(camera, truth, 100, 210, 40));
  TrackingPrediction prediction;
  prediction.relative = truth;
  TrackingOptions options;
  const auto sigmaOfBearing = [&](double alpha) {
    options.energy.alpha = alpha;
    const TrackingResult tracked = trackTrunk(gradient, camera, prediction, options);
    return camera.fx / std::sqrt(tracked.F(2, 2)); // with r/d known [px]
  };
  // two borders of 1/alpha px^2 each
  EXPECT_NEAR(sigmaOfBearing(0.5), 1, 0.35);
  EXPECT_NEAR(sigmaOfBearing(0.5) / sigmaOfBearing(2), 2, 0.01);
}
} // namespace
