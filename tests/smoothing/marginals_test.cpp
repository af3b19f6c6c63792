// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/dense_reference.h"
#include "support/differences.h"
#include "support/flight.h"

using namespace bole;

namespace
{
using namespace test;

/// Of x and y of a trunk as a pose has them, along the axes of the world there.
Eigen::Vector2d placeSeenFrom(const Pose &wMb, const Trunk &trunk, double heading)
{
  const double turned = std::atan2(wMb.R(1, 0), wMb.R(0, 0)) - heading;
  return Eigen::Rotation2Dd(-turned) * (trunk.xy - wMb.t.head<2>());
}

TEST(Marginals, AgreeWithTheInverseOfTheWholeSystem)
{
  FlightOptions o{50};
  const Flight flight = simulateFlight(o);
  Replay replay(flight, smootherFor(o));
  replay.run();
  Smoother &smoother = replay.smoother;
  smoother.optimize(1e-12);
  DenseReference dense(smoother.graph());
  const Eigen::MatrixXd C = dense.covariance();
  const int p = dense.poseRow(49);

  EXPECT_TRUE(smoother.currentPoseCovariance().isApprox(C.block(p, p, 6, 6), 1e-4));
  for (std::size_t j = 0; j < dense.graph().trunks.size(); ++j) {
    const int t = dense.trunkRow(j);
    EXPECT_TRUE(smoother.trunkCovariance(j).isApprox(C.block(t, t, 5, 5), 1e-4)) << j;
    Matrix46d J_pose;
    Matrix45d J_trunk;
    relativeTrunk(smoother.pose(49), smoother.options().bMc, smoother.trunk(j), &J_pose, &J_trunk);
    const Matrix4d cross = J_pose * C.block(p, t, 6, 5) * J_trunk.transpose();
    const Matrix4d expected = J_pose * C.block(p, p, 6, 6) * J_pose.transpose() +
                              J_trunk * C.block(t, t, 5, 5) * J_trunk.transpose() + cross + cross.transpose();
    EXPECT_TRUE(smoother.relativeCovariance(j).isApprox(expected, 1e-4)) << j;
    EXPECT_NEAR(smoother.bearingVariance(j), expected(2, 2), 1e-4 * expected(2, 2)) << j;

    // its place as the last pose has it that saw it
    std::size_t last = 0;
    for (const Graph::ObservationEdge &view : dense.graph().observations)
      if (view.trunk == j)
        last = std::max(last, view.pose);
    const Pose wMb = smoother.pose(last);
    const Trunk trunk = smoother.trunk(j);
    const double heading = std::atan2(wMb.R(1, 0), wMb.R(0, 0));
    const auto place = [&](const Eigen::VectorXd &xi) {
      return placeSeenFrom(wMb.plus(xi.head<6>()), trunk.plus(xi.tail<5>()), heading);
    };
    const Eigen::MatrixXd J = differences(place, 11, 1e-5);
    const int l = dense.poseRow(last);
    Eigen::Matrix<double, 11, 11> joint;
    joint << C.block(l, l, 6, 6), C.block(l, t, 6, 5), C.block(t, l, 5, 6), C.block(t, t, 5, 5);
    EXPECT_TRUE(smoother.placeCovariance(j).isApprox(J * joint * J.transpose(), 1e-3)) << j;
  }
}

TEST(Marginals, APlaceAsSeenIsAsWellKnownHoweverFarThePathHasDrifted)
{
  FlightOptions o{800};
  const Flight flight = simulateFlight(o);
  SmootherOptions options = smootherFor(o);
  Replay whole(flight, options);
  whole.run();
  whole.smoother.optimize();
  options.window = 60;
  options.forgets = true;
  Replay window(flight, options);
  window.run();
  const auto place = [](const Replay &replay, int trunk) {
    return std::sqrt(replay.smoother.placeCovariance(static_cast<std::size_t>(replay.trunk_id[trunk])).trace());
  };
  const auto inWorld = [](const Replay &replay, int trunk) {
    const auto id = static_cast<std::size_t>(replay.trunk_id[trunk]);
    return std::sqrt(replay.smoother.trunkCovariance(id).topLeftCorner<2, 2>().trace());
  };
  double early = 0, late = 0, early_in_world = 0, late_in_world = 0;
  for (int trunk = 0; trunk < 36; ++trunk) { // passed by the end
    if (whole.trunk_id[trunk] < 0)
      continue;                                                                // never among the nearest
    EXPECT_NEAR(place(window, trunk) / place(whole, trunk), 1, 0.25) << trunk; // one that left the window, too
    (trunk < 18 ? early : late) += place(whole, trunk);
    (trunk < 18 ? early_in_world : late_in_world) += inWorld(whole, trunk);
  }
  EXPECT_GT(late_in_world, 2 * early_in_world);
  EXPECT_NEAR(late / early, 1, 0.3); // each scatters by .3 with its distance: 3 sigma of the ratio of two sums of 18
}

/// Share of runs whose NEES, summed over trunks (or averaged over poses), lies in its 95 %
/// chi-square band.
TEST(Marginals, ErrorsOfManyFlightsAreWhatTheCovariancesSay)
{
  int trunks_in = 0, poses_in = 0;
  double trunk_mean = 0, pose_mean = 0; // NEES over degrees of freedom
  const int runs = 60;
  for (int run = 0; run < runs; ++run) {
    FlightOptions o{60};
    o.seed = 100 + run;
    const Flight flight = simulateFlight(o);
    SmootherOptions options = smootherFor(o);
    options.summary_loss.kind = LossKind::quadratic; // the noise is Gaussian
    Replay replay(flight, options);
    replay.run();
    replay.smoother.optimize();
    DenseReference dense(replay.smoother.graph());
    const Eigen::MatrixXd C = dense.covariance();
    const int from = dense.trunkRow(0), count = static_cast<int>(C.rows()) - from;
    Eigen::VectorXd error(count);
    for (std::size_t j = 0; j < flight.trunks.size(); ++j)
      if (replay.trunk_id[j] >= 0)
        error.segment<5>(5 * replay.trunk_id[j]) = replay.smoother.trunk(replay.trunk_id[j]).minus(flight.trunks[j]);
    const double trunk_nees = error.dot(C.block(from, from, count, count).llt().solve(error));
    const Vector6d pose_error = replay.smoother.pose(59).minus(flight.truth[59]);
    const double pose_nees = pose_error.dot(replay.smoother.poseCovariance(59).llt().solve(pose_error));
    // chi-square quantiles by Wilson and Hilferty
    const auto quantile = [](double n, double z) {
      return n * std::pow(1 - 2 / (9 * n) + z * std::sqrt(2 / (9 * n)), 3);
    };
    trunk_mean += trunk_nees / count / runs;
    pose_mean += pose_nees / 6 / runs;
    trunks_in += trunk_nees > quantile(count, -1.96) && trunk_nees < quantile(count, 1.96);
    poses_in += pose_nees > quantile(6, -1.96) && pose_nees < quantile(6, 1.96);
  }
  EXPECT_NEAR(trunk_mean, 1, 0.1);
  EXPECT_NEAR(pose_mean, 1, 0.25);
  EXPECT_GE(trunks_in, 0.9 * runs);
  EXPECT_GE(poses_in, 0.9 * runs);
}

struct OneTrunk : testing::Test
{
  SmootherOptions options;
  Smoother smoother{options};
  std::size_t pose = smoother.addFirstPose(Pose(), 1e-6 * Matrix6d::Identity());
  Trunk truth;
  SummaryFactor view()
  {
    SummaryFactor summary;
    summary.optimum = relativeTrunk(smoother.pose(pose), options.bMc, truth);
    summary.F = Vector4d(1e5, 1e3, 1e5, 400).asDiagonal();
    return summary;
  }
  void SetUp() override { truth.xy << 5, 1; }
};

TEST_F(OneTrunk, SeenOnceStaysOnItsRadiusPriorAndItsCovarianceSaysSo)
{
  const std::size_t trunk = smoother.addTrunk(truth);
  smoother.addObservation(pose, trunk, view());

  const UpdateResult result = smoother.update();

  EXPECT_EQ(result.status, UpdateStatus::ok);
  const Matrix5d C = smoother.trunkCovariance(trunk);
  EXPECT_NEAR(std::sqrt(C(2, 2)), options.prior_log_radius_sigma, 0.05);
  EXPECT_GT(std::sqrt(C(0, 0)), 0.4 * options.prior_log_radius_sigma * 5);
}

TEST_F(OneTrunk, WithARankOneSummaryOrNoneIsSolvedAllTheSame)
{
  const std::size_t unseen = smoother.addTrunk(truth);
  const std::size_t trunk = smoother.addTrunk(truth);
  SummaryFactor bearing = view();
  bearing.F = Vector4d(0, 0, 1e5, 0).asDiagonal();
  EXPECT_EQ(smoother.addObservation(pose, trunk, bearing), SummaryStatus::ok);

  const UpdateResult result = smoother.update();

  EXPECT_EQ(result.status, UpdateStatus::ok);
  EXPECT_NEAR(std::sqrt(smoother.trunkCovariance(unseen)(0, 0)), options.prior_position_sigma, 1e-6);
  EXPECT_GT(std::sqrt(smoother.trunkCovariance(trunk)(0, 0)), 5);
}

TEST_F(OneTrunk, RefusesIndefiniteAndNonFiniteSummaries)
{
  const std::size_t trunk = smoother.addTrunk(truth);
  SummaryFactor indefinite = view(), broken = view(), nearly = view();
  indefinite.F(0, 0) = -1e4;
  broken.f(2) = std::nan("");
  nearly.F(3, 3) = -1;

  EXPECT_EQ(smoother.addObservation(pose, trunk, indefinite), SummaryStatus::indefinite);
  EXPECT_EQ(smoother.addObservation(pose, trunk, broken), SummaryStatus::not_finite);
  EXPECT_EQ(smoother.addObservation(pose, trunk, nearly), SummaryStatus::projected);
  EXPECT_EQ(smoother.observationCount(), 1u);
}

TEST_F(OneTrunk, RefusesWhatTheCallerGotWrong)
{
  Matrix6d indefinite = Matrix6d::Identity();
  indefinite(0, 0) = -1;
  EXPECT_THROW(smoother.addPose(Pose(), indefinite), vpException);
  EXPECT_EQ(smoother.poseCount(), 1u);
  EXPECT_THROW(smoother.addFirstPose(Pose(), Matrix6d::Identity()), vpException);
  SmootherOptions wrong;
  wrong.window = 1;
  EXPECT_THROW(wrong.validate(), vpException);
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  const TrunkPrior weak = {truth, Vector5d::Constant(3)};
  Trunk nowhere = truth;
  nowhere.xy.x() = kNaN;
  TrunkPrior unknown = weak, sure = weak, unsure = weak;
  unknown.mean.log_radius = kNaN;
  sure.sigma(4) = 0;
  unsure.sigma(0) = std::numeric_limits<double>::infinity();
  EXPECT_THROW(smoother.addTrunk(nowhere, weak), vpException);
  for (const TrunkPrior &prior : {unknown, sure, unsure})
    EXPECT_THROW(smoother.addTrunk(truth, prior), vpException);
  const std::size_t trunk = smoother.addTrunk(truth, weak);
  for (const std::size_t none : {trunk + 1, std::size_t(-1)}) {
    EXPECT_THROW(smoother.addObservation(pose, none, view()), vpException);
    EXPECT_THROW(smoother.addObservation(pose + 1, trunk, view()), vpException);
    EXPECT_THROW(smoother.mergeTrunks(trunk, none), vpException);
    EXPECT_THROW(smoother.removeTrunk(none), vpException);
    EXPECT_THROW(smoother.keepTrunk(none, true), vpException);
    EXPECT_THROW(smoother.trunk(none), vpException);
    EXPECT_THROW(smoother.trunkCovariance(none), vpException);
    EXPECT_THROW(smoother.pose(none), vpException);
    EXPECT_THROW(smoother.addPosePrior(none, {}), vpException);
    EXPECT_THROW(smoother.addOdometry(pose, none, {}), vpException);
    EXPECT_THROW(smoother.addRelativePose(none, pose, {}), vpException);
  }
  EXPECT_THROW(smoother.mergeTrunks(trunk, trunk), vpException);
  EXPECT_THROW(smoother.addOdometry(pose, pose, {}), vpException);
  smoother.removeTrunk(trunk);
  EXPECT_THROW(smoother.trunk(trunk), vpException);
}
} // namespace
