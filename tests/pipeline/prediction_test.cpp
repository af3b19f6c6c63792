// SPDX-License-Identifier: GPL-2.0-or-later
// What hides what, and where the detectors need not look.
#include "support/test.h"

#include "pipeline/prediction.h"
#include "pipeline/trunk_measurement.h"

using namespace bole;

namespace
{
const Pose kMount = SmootherOptions::forwardCamera();

Trunk trunkAt(double x, double y, double radius = 0.15, Eigen::Vector2d lean = {0, 0})
{
  return {{x, y}, std::log(radius), lean};
}

/// A camera at eye height that looks along x.
Viewpoint eye()
{
  Viewpoint view;
  view.wMc = Pose(Eigen::Matrix3d::Identity(), {0, 0, 1.2}) * kMount;
  view.ground = GroundPlane();
  return view;
}

TrunkMap mapOf(std::initializer_list<std::pair<Trunk, TrunkStatus>> trunks)
{
  std::vector<MapTrunk> known;
  for (const auto &[trunk, status] : trunks) {
    MapTrunk one;
    one.id = static_cast<int>(known.size());
    one.trunk = trunk;
    one.status = status;
    known.push_back(one);
  }
  return TrunkMap(MapOptions(), known);
}

TEST(Occlusion, ANearerConfirmedTrunkHidesTheBorderBehindIt)
{
  // 0.15 m at 3 m fill 0.05 rad to either side; the trunk behind reaches from 0.04 to 0.09 rad to the left
  const TrunkMap map = mapOf({{trunkAt(3, 0), TrunkStatus::confirmed}});
  const Trunk behind = trunkAt(6, 0.39);
  const HiddenBorders hidden = hiddenBorders(behind, -1, map, eye());
  EXPECT_FALSE(hidden.left);
  EXPECT_TRUE(hidden.right);
  const HiddenBorders mirrored = hiddenBorders(trunkAt(6, -0.39), -1, map, eye());
  EXPECT_TRUE(mirrored.left);
  EXPECT_FALSE(mirrored.right);
}

TEST(Occlusion, NeitherACandidateNorAFartherTrunkNorTheTrunkItselfHidesABorder)
{
  const TrunkMap map = mapOf({{trunkAt(3, 0), TrunkStatus::candidate},
                              {trunkAt(9, 0.39), TrunkStatus::confirmed},
                              {trunkAt(5.5, 0.39), TrunkStatus::confirmed}});
  const HiddenBorders hidden = hiddenBorders(trunkAt(6, 0.39), 2, map, eye());
  EXPECT_FALSE(hidden.left || hidden.right);
}

TEST(Occlusion, IsAskedAtTheHeightOfTheCameraWhereTheTrunkLeans)
{
  // leaning by 0.1 to the left: at the height of the camera the trunk stands 0.12 m to the left of its foot
  const TrunkMap map = mapOf({{trunkAt(3, -0.12, 0.15, {0, 0.1}), TrunkStatus::confirmed}});
  EXPECT_TRUE(hiddenBorders(trunkAt(6, 0.39), -1, map, eye()).right);
  const TrunkMap upright = mapOf({{trunkAt(3, -0.12), TrunkStatus::confirmed}});
  EXPECT_FALSE(hiddenBorders(trunkAt(6, 0.39), -1, upright, eye()).right);
}

TEST(Inhibition, TakesTheColumnsOfConfirmedTrunksAndOfCandidatesOnRequest)
{
  const TrunkMap map = mapOf({{trunkAt(4, 1), TrunkStatus::confirmed}, {trunkAt(4, -1), TrunkStatus::candidate}});
  const auto known = inhibitedRanges(map, eye(), false), all = inhibitedRanges(map, eye(), true);
  ASSERT_EQ(known.size(), 1u);
  EXPECT_EQ(all.size(), 2u);
  EXPECT_LT(known[0].q_right, 0.25 - 0.15 / 4.2);
  EXPECT_GT(known[0].q_left, 0.25 + 0.15 / 4.2);
  EXPECT_LT(known[0].q_left - known[0].q_right, 2 * (0.15 / 4 + 2 / eye().camera.fx));
}

/// The path drifts by a centimetre a frame: after n frames by sqrt(n) cm, which thrice is more than 2 * 0.15 m from 100
/// on.
TEST(Prediction, ATrunkIsPlacedWhileTheDriftIsNoMoreThanItsWidth)
{
  Matrix6d drift = 1e-10 * Matrix6d::Identity();
  drift(1, 1) = 1e-4; // [m^2], sideways
  Smoother smoother;
  smoother.addFirstPose(Pose(Eigen::Matrix3d::Identity(), {0, 0, 1.2}), 1e-10 * Matrix6d::Identity());
  MapTrunk known;
  known.status = TrunkStatus::confirmed;
  known.trunk = trunkAt(4, 0.5);
  const TrunkPrior prior{known.trunk, Vector5d::Constant(1e-4)};
  known.smoother_id = smoother.addTrunk(known.trunk, prior);
  const TrunkMap map(MapOptions(), {known});
  Viewpoint view = eye();
  for (int frame = 1; frame <= 140; ++frame) {
    smoother.addPose(Pose(), drift);
    smoother.update();
    const auto predicted = predictTrunks(map, smoother, view, StageOptions());
    ASSERT_EQ(predicted.size(), 1u);
    if (std::abs(frame - 100) > 3) {
      EXPECT_EQ(predicted[0].is_placed, frame < 100) << frame;
    }
  }
  view.has_ranges = false; // its range is a guess
  EXPECT_TRUE(predictTrunks(map, smoother, view, StageOptions())[0].is_placed);
}

TEST(Elevation, IsThatOfTwoHeightsOverTheGround)
{
  StageOptions options;
  const Trunk trunk = trunkAt(4, 0);
  Viewpoint view = eye();
  const RelativeTrunk relative = relativeTrunk(view.wMc, Pose(), trunk);
  const ElevationRange range = elevationOf(relative, trunk, view, options);
  EXPECT_NEAR(range.low, (options.flow.trunk_low - 1.2) / 4, 1e-3);
  EXPECT_NEAR(range.high, (options.flow.trunk_high - 1.2) / 4, 1e-3);
  view.ground.reset();
  EXPECT_EQ(elevationOf(relative, trunk, view, options).high, options.detection.profile.range.high);
}

// The gate between a prediction and what was found, and what a view counts for.

constexpr double kFocal = 200;

struct Case
{
  TrackingPrediction prediction;
  TrackingResult result;
  FlowOptions options;
};

/// A trunk found \p bearing [rad] and \p log_ratio off its prediction.
Case found(double bearing, double log_ratio = 0)
{
  Case c;
  c.prediction.relative.log_ratio = std::log(0.05);
  c.prediction.covariance = Vector4d(1e-4, 1e-4, std::pow(0.01, 2), std::pow(0.1, 2)).asDiagonal();
  c.result.status = TrackingStatus::tracked;
  c.result.optimum = c.prediction.relative.plus({0, 0, bearing, log_ratio});
  c.result.left_used = c.result.right_used = true;
  c.result.left_contrast = -0.1;
  c.result.right_contrast = 0.1;
  return c;
}

bool isInside(const Case &c) { return isInsideGate(c.prediction, c.result, kFocal, c.options); }

TEST(Gate, IsAsWideAsPredictionAndBordersTogether)
{
  const double sigma = std::hypot(0.01, 1.0 / kFocal); // of the bearing
  const double edge = std::sqrt(FlowOptions().gate) * sigma;
  EXPECT_TRUE(isInside(found(0.99 * edge)));
  EXPECT_TRUE(isInside(found(-0.99 * edge)));
  EXPECT_FALSE(isInside(found(1.01 * edge)));
}

TEST(Gate, AsksTheWidthOnlyWhereBothBordersWereSeen)
{
  Case c = found(0, 2);
  EXPECT_FALSE(isInside(c));
  c.result.right_used = false;
  EXPECT_TRUE(isInside(c));
}

TEST(Gate, IsWiderWhereThePredictionKnowsLess)
{
  Case c = found(0.1);
  EXPECT_FALSE(isInside(c));
  c.prediction.covariance(2, 2) = 0.01;
  EXPECT_TRUE(isInside(c));
}

TEST(Misfit, GrowsWithTheSquareOfTheOffsetInPixelsAndEndsSomewhere)
{
  const auto misfitOf = [](double pixels) {
    const Case c = found(pixels / kFocal);
    return meanSquaredInnovation(c.result, c.prediction.relative, kFocal, c.options);
  };
  EXPECT_NEAR(misfitOf(2) / misfitOf(1), 4, 1e-6);
  EXPECT_EQ(misfitOf(4), misfitOf(40));
}

TEST(Misfit, AllowsMoreToFaintBorders)
{
  Case c = found(1 / kFocal);
  const double strong = meanSquaredInnovation(c.result, c.prediction.relative, kFocal, c.options);
  c.result.left_contrast = -0.01;
  EXPECT_LT(meanSquaredInnovation(c.result, c.prediction.relative, kFocal, c.options), 0.5 * strong);
}

TEST(WeightOfView, IsTheShareOfTheWayThatMakesViewsIndependent)
{
  FlowOptions options;
  const Eigen::Vector3d here(1, 2, 3), near(1, 2.02, 3), far(1, 3, 3);
  EXPECT_EQ(weightOfView(here, near, options), 1); // every view counts
  options.view_correlation = 0.1;
  EXPECT_EQ(weightOfView(std::nullopt, near, options), 1);
  EXPECT_NEAR(weightOfView(here, near, options), 0.2, 1e-9);
  EXPECT_EQ(weightOfView(here, far, options), 1);
  EXPECT_GT(weightOfView(here, here, options), 0); // holds the pose of a drone at rest
}
} // namespace
