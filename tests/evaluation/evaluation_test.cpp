// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "evaluation/trajectory_metrics.h"
#include "evaluation/trunk_metrics.h"
#include "geometry/so3.h"
#include "input/recorded_source.h"
#include "input/trajectory.h"
#include "output/trunks_csv.h"
#include <bole/evaluation.h>
#include <nlohmann/json.hpp>

using namespace bole;

namespace
{
constexpr double kDegree = M_PI / 180;

Pose poseAt(double x, double y, double z, double yaw) { return {expSo3({0, 0, yaw}), {x, y, z}}; }

/// A curve that is not a line, one pose each 0.1 s.
Trajectory curve(std::size_t poses)
{
  Trajectory trajectory;
  for (std::size_t i = 0; i < poses; ++i) {
    const double s = 0.1 * static_cast<double>(i);
    trajectory.push_back({static_cast<std::int64_t>(i) * 100000000, poseAt(s, std::sin(s), 1.2, 0.3 * s)});
  }
  return trajectory;
}

/// The trajectory whose image under \p transform is \p truth.
Trajectory undone(const PlanarTransform &transform, const Trajectory &truth)
{
  Trajectory estimate = truth;
  for (StampedPose &pose : estimate) {
    const Eigen::Vector2d xy = transform.linear().inverse() * (pose.wMb.t.head<2>() - transform.t);
    pose.wMb.t.head<2>() = xy;
    pose.wMb.R = expSo3({0, 0, -transform.yaw}) * pose.wMb.R;
  }
  return estimate;
}

TrunkRecord confirmed(int id, double x, double y, double radius = 0.2, double variance = 0.01)
{
  TrunkRecord trunk;
  trunk.id = id;
  trunk.xy = {x, y};
  trunk.radius = radius;
  trunk.covariance = variance * TrunkRecord::Covariance::Identity();
  trunk.status = TrunkStatus::confirmed;
  return trunk;
}

TruthTrunk tree(int id, double x, double y, double radius = 0.2) { return {id, {x, y}, radius, 0}; }

TrunkVisibility expected() { return {20, 15, 3, true}; }

const Alignments kIdentity{};
} // namespace

TEST(Assignment, IsAsGoodAsTheBestOfAllPermutations)
{
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Index n = 1 + trial % 6, m = 1 + (trial / 6) % 6;
    Eigen::MatrixXd cost(n, m);
    for (Eigen::Index i = 0; i < n * m; ++i)
      cost.data()[i] = uniform(random);
    const double gate = 0.6;

    const std::vector<int> pairs = assign(cost, gate);

    int count = 0;
    double sum = 0;
    std::vector<int> used(static_cast<std::size_t>(m), 0);
    for (Eigen::Index i = 0; i < n; ++i)
      if (pairs[static_cast<std::size_t>(i)] >= 0) {
        const int column = pairs[static_cast<std::size_t>(i)];
        EXPECT_LE(cost(i, column), gate);
        EXPECT_EQ(used[static_cast<std::size_t>(column)]++, 0);
        ++count;
        sum += cost(i, column);
      }
    std::vector<int> order(static_cast<std::size_t>(std::max(n, m)));
    std::iota(order.begin(), order.end(), 0);
    int best_count = 0;
    double best_sum = 0;
    do {
      int c = 0;
      double s = 0;
      for (Eigen::Index i = 0; i < n; ++i) {
        const int column = order[static_cast<std::size_t>(i)];
        if (column < m && cost(i, column) <= gate) {
          ++c;
          s += cost(i, column);
        }
      }
      if (c > best_count || (c == best_count && s < best_sum)) {
        best_count = c;
        best_sum = s;
      }
    } while (std::next_permutation(order.begin(), order.end()));
    EXPECT_EQ(count, best_count);
    EXPECT_NEAR(sum, best_sum, 1e-12);
  }
  EXPECT_EQ(assign(Eigen::MatrixXd(2, 0), 1), (std::vector<int>{-1, -1})) << "nobody is in an empty set";
  EXPECT_TRUE(assign(Eigen::MatrixXd(0, 3), 1).empty());
}

TEST(TrajectoryMetrics, AlignmentRecoversAPlanarTransformExactly)
{
  const Trajectory truth = curve(60);
  const PlanarTransform transform{1.3, 2.5, {4, -7}, 0};
  const auto pairs = pairPoses(undone(transform, truth), truth);

  const PlanarTransform scaled = align(pairs, Alignment::xy_yaw_scale);

  EXPECT_NEAR(scaled.scale, 1.3, 1e-12);
  EXPECT_NEAR(std::remainder(scaled.yaw - 2.5, 2 * M_PI), 0, 1e-12);
  EXPECT_LT((scaled.t - transform.t).norm(), 1e-10);
  EXPECT_NEAR(absoluteErrors(pairs, scaled).ate, 0, 1e-10);
  EXPECT_NEAR(absoluteErrors(pairs, scaled).rotation_deg, 0, 1e-6);
  EXPECT_GT(absoluteErrors(pairs, align(pairs, Alignment::xy_yaw)).ate, 0.1);
}

TEST(TrajectoryMetrics, AlignmentIsTheLeastSquaresOptimum)
{
  const Trajectory truth = curve(40);
  Trajectory estimate = truth;
  std::mt19937 random(2);
  std::normal_distribution<double> noise(0, 0.2);
  for (StampedPose &pose : estimate)
    pose.wMb.t += Eigen::Vector3d(noise(random) + 1, noise(random), 0);
  const auto pairs = pairPoses(estimate, truth);
  const PlanarTransform best = align(pairs, Alignment::xy_yaw_scale);
  const double least = absoluteErrors(pairs, best).ate;
  for (const double step : {-1e-3, 1e-3}) {
    PlanarTransform other = best;
    other.scale += step;
    EXPECT_GT(absoluteErrors(pairs, other).ate, least);
    other = best;
    other.yaw += step;
    EXPECT_GT(absoluteErrors(pairs, other).ate, least);
    other = best;
    other.t.x() += step;
    EXPECT_GT(absoluteErrors(pairs, other).ate, least);
  }
}

TEST(TrajectoryMetrics, FirstPoseAlignmentPutsTheFirstPoseOnTheTruthAndPosesOutsideOfItDoNotCount)
{
  const Trajectory truth = curve(10);
  Trajectory estimate = undone({1, 0.4, {2, 3}, 0}, truth);
  estimate.push_back({5000000000LL, Pose()});
  const auto pairs = pairPoses(estimate, truth);
  ASSERT_EQ(pairs.size(), 10u);
  const PlanarTransform transform = align(pairs, Alignment::first_pose);
  EXPECT_LT(((transform * pairs[0].estimate).minus(pairs[0].truth)).norm(), 1e-12);
  EXPECT_NEAR(absoluteErrors(pairs, transform).ate, 0, 1e-12);
}

/// A walk whose steps scatter by .1 m, and a world that is turned.
TEST(TrajectoryMetrics, HonestCovariancesOfAWalkAreConsistent)
{
  std::mt19937 random(3);
  std::normal_distribution<double> step(0, 0.1);
  const PlanarTransform turned{1, 0.7, {3, -2}, 0};
  double sum = 0;
  constexpr int kWalks = 200;
  for (int walk = 0; walk < kWalks; ++walk) {
    std::vector<PosePair> pairs;
    std::map<std::int64_t, Eigen::Matrix2d> covariances;
    Eigen::Vector3d off = Eigen::Vector3d::Zero();
    for (int k = 0; k < 30; ++k) {
      PosePair pair;
      pair.stamp_ns = k;
      pair.estimate.t = Eigen::Vector3d(k, 0.1 * k, 1) + off;
      pair.truth = turned * Pose(Eigen::Matrix3d::Identity(), Eigen::Vector3d(k, 0.1 * k, 1));
      pairs.push_back(pair);
      covariances[k] = Eigen::Vector2d(0.01 * k, 0.04 * k).asDiagonal();
      off += Eigen::Vector3d(step(random), 2 * step(random), 0);
    }
    sum += consistency(pairs, covariances, align(pairs, Alignment::first_pose));
    EXPECT_TRUE(std::isnan(consistency(pairs, {}, turned)));
  }
  EXPECT_NEAR(sum / kWalks, 1, 0.2);
}

TEST(TrunkMetrics, CountsMatchesMissesDuplicatesAndFalsePositives)
{
  const std::vector<TruthTrunk> truth = {tree(0, 5, 0), tree(1, 5, 3), tree(2, 8, -2), {10000, {40, 0}, 0, 0}};
  const std::vector<TrunkVisibility> seen = {expected(), expected(), expected(), {}};
  std::vector<TrunkRecord> map = {confirmed(7, 5.1, 0), confirmed(8, 5, 0.3), confirmed(9, 40, 0.2),
                                  confirmed(10, 20, 20), confirmed(11, 8, -2)};
  map.back().status = TrunkStatus::candidate;

  const TrunkMetrics metrics = trunkMetrics(map, truth, seen, kIdentity);

  EXPECT_EQ(metrics.confirmed, 4u);
  EXPECT_DOUBLE_EQ(metrics.precision, 0.5);
  EXPECT_DOUBLE_EQ(metrics.duplicates, 0.25);
  EXPECT_DOUBLE_EQ(metrics.recall, 1.0 / 3);
  EXPECT_NEAR(metrics.f1, 2 * 0.5 / 3 / (0.5 + 1.0 / 3), 1e-12);
  ASSERT_EQ(metrics.matches.size(), 2u);
  EXPECT_EQ(metrics.matches[0].estimate.id, 7);
  ASSERT_EQ(metrics.misses.size(), 2u);
  EXPECT_EQ(metrics.misses[1].id, 2);
  EXPECT_EQ(metrics.misses[1].nearest_id, 11);
  ASSERT_EQ(metrics.false_positives.size(), 2u);
  EXPECT_TRUE(metrics.false_positives[0].is_duplicate);
  EXPECT_EQ(metrics.false_positives[0].nearest_id, 0);
  EXPECT_FALSE(metrics.false_positives[1].is_duplicate);
}

TEST(TrunkMetrics, MeasuresPositionRadiusAndHonesty)
{
  const std::vector<TruthTrunk> truth = {tree(0, 5, 0, 0.2), tree(1, 5, 3, 0.3), tree(2, 9, 9, 0.1)};
  const std::vector<TrunkVisibility> seen(3, expected());
  const std::vector<TrunkRecord> map = {confirmed(0, 5.1, 0, 0.21, 0.01), confirmed(1, 5, 3.2, 0.27, 0.01),
                                        confirmed(2, 9, 9.3, 0.1, 0.01)};

  const TrunkErrors errors = trunkMetrics(map, truth, seen, kIdentity).all;

  EXPECT_NEAR(errors.median[0], 0.2, 1e-12);
  EXPECT_NEAR(errors.rmse[0], std::sqrt((0.01 + 0.04 + 0.09) / 3), 1e-12);
  EXPECT_NEAR(errors.nees_half, (1 + 4 + 9) / 6.0, 1e-9);
  EXPECT_NEAR(errors.predicted_sigma, std::sqrt(0.02), 1e-12);
  EXPECT_NEAR(errors.radius_rmse, std::sqrt((1e-4 + 9e-4) / 3), 1e-12);
  EXPECT_NEAR(errors.radius_bias, -0.02 / 3, 1e-12);
}

TEST(TrunkMetrics, TurnsTheCovarianceWithTheGauge)
{
  TrunkRecord trunk = confirmed(0, 0, 0);
  trunk.covariance.topLeftCorner<2, 2>() = Eigen::Vector2d(0.04, 0.0001).asDiagonal();
  Alignments alignments{};
  alignments[static_cast<std::size_t>(Alignment::first_pose)] = {1, M_PI / 2, {5, 0.2}, 0};
  alignments[static_cast<std::size_t>(Alignment::xy_yaw)] = {1, M_PI / 2, {5, 0.2}, 0};

  const TrunkMetrics metrics = trunkMetrics({trunk}, {tree(0, 5, 0)}, {expected()}, alignments);

  ASSERT_EQ(metrics.matches.size(), 1u);
  EXPECT_NEAR(metrics.matches[0].nees_half, 0.5, 1e-9);
}

TEST(TrunkMetrics, BinsAddUpToTheWhole)
{
  std::vector<TruthTrunk> truth;
  std::vector<TrunkVisibility> seen;
  std::vector<TrunkRecord> map;
  for (int i = 0; i < 12; ++i) {
    truth.push_back(tree(i, 3 * i, 0));
    seen.push_back({20, 5.0 * i + 3, 0.6 * i + 0.5, true});
    if (i % 3 != 0)
      map.push_back(confirmed(i, 3 * i, 0.1));
  }
  const TrunkMetrics metrics = trunkMetrics(map, truth, seen, kIdentity);
  for (const auto *bins : {&metrics.by_range, &metrics.by_parallax}) {
    std::size_t expected_sum = 0, found = 0;
    for (const TrunkBin &bin : *bins) {
      expected_sum += bin.errors.expected;
      found += bin.errors.found;
    }
    EXPECT_EQ(expected_sum, 12u);
    EXPECT_EQ(found, 8u);
  }
}

TEST(TrunkMetrics, WhatCouldNotBeMeasuredIsNoNumber)
{
  const TrunkMetrics nothing_matched = trunkMetrics({confirmed(0, 9, 9)}, {tree(0, 1, 1)}, {expected()}, kIdentity);
  EXPECT_EQ(nothing_matched.recall, 0);
  EXPECT_EQ(nothing_matched.precision, 0);
  EXPECT_EQ(nothing_matched.f1, 0);
  const TrunkErrors &all = nothing_matched.all;
  for (const double figure :
       {all.median[0], all.rmse[2], all.nees_half, all.predicted_sigma, all.radius_rmse, all.radius_bias})
    EXPECT_TRUE(std::isnan(figure));

  const TrunkMetrics empty_map = trunkMetrics({}, {tree(0, 1, 1)}, {expected()}, kIdentity);
  EXPECT_EQ(empty_map.recall, 0);
  EXPECT_TRUE(std::isnan(empty_map.precision) && std::isnan(empty_map.f1) && std::isnan(empty_map.duplicates));
  EXPECT_TRUE(std::isnan(trunkMetrics({confirmed(0, 1, 1)}, {}, {}, kIdentity).recall));
  EXPECT_TRUE(std::isnan(empty_map.misses.at(0).nearest_distance));

  const TrunkMetrics far = trunkMetrics({confirmed(0, 5, 0)}, {{10000, {5, 0}, 0, 0}}, {{}}, kIdentity);
  EXPECT_TRUE(std::isnan(far.all.radius_bias)); // the truth has no radius
  EXPECT_EQ(far.precision, 1);
  EXPECT_TRUE(std::isnan(absoluteErrors({}, {}).ate));
  EXPECT_TRUE(std::isnan(relativeErrors({PosePair()}, 1).translation));
}

namespace
{
const Pose kForward((Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished(), Eigen::Vector3d::Zero());

std::vector<Pose> walk(std::size_t frames)
{
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < frames; ++i)
    poses.push_back(poseAt(0, 0.1 * static_cast<double>(i), 1.2, 0));
  return poses;
}
} // namespace

TEST(Visibility, ExpectsTrunksThatAreNearInsideAndFree)
{
  // Facing x, moving along y by 0.9 m: a trunk at 5 m changes its bearing by 10 degrees.
  const std::vector<TruthTrunk> trunks = {
      tree(0, 5, 0.5),         // seen
      tree(1, 7.5, 0.75, 0.1), // behind trunk 0 in part of the frames
      tree(2, 9, 0),           // too far
      tree(3, -5, 0),          // behind the camera
      tree(4, 1, 3),           // outside the image
      {10000, {5, -0.5}, 0, 0} // no radius
  };
  const auto seen = trunkVisibility(trunks, walk(10), kForward, PinholeCamera());

  EXPECT_TRUE(seen[0].is_expected);
  EXPECT_EQ(seen[0].frames, 10u);
  EXPECT_NEAR(seen[0].bearing_change, (std::atan(0.1) + std::atan(0.08)) / kDegree, 1e-9);
  EXPECT_NEAR(seen[0].min_range, 5, 1e-9);
  EXPECT_LT(seen[1].frames, 10u);
  EXPECT_GT(seen[1].frames, 0u);
  for (std::size_t i = 2; i < trunks.size(); ++i)
    EXPECT_EQ(seen[i].frames, 0u) << i;
}

TEST(Visibility, AsksForEnoughFramesAndParallax)
{
  const std::vector<TruthTrunk> trunks = {tree(0, 5, 0.5)};
  EXPECT_FALSE(trunkVisibility(trunks, walk(7), kForward, PinholeCamera())[0].is_expected);
  EXPECT_TRUE(trunkVisibility(trunks, walk(8), kForward, PinholeCamera())[0].is_expected);
  const std::vector<Pose> still(20, poseAt(0, 0, 1.2, 0));
  EXPECT_FALSE(trunkVisibility(trunks, still, kForward, PinholeCamera())[0].is_expected);
}

TEST(Visibility, AddsUpWhatSeveralNearerTrunksHide)
{
  // Two thin trunks that overlap each other cover the left 60 % of a thick one.
  const std::vector<Pose> still(1, poseAt(0, 0, 1.2, 0));
  const std::vector<TruthTrunk> half = {tree(0, 6, 0, 0.3), tree(1, 3, 0.10, 0.05)};
  EXPECT_EQ(trunkVisibility(half, still, kForward, PinholeCamera())[0].frames, 1u);
  const std::vector<TruthTrunk> most = {tree(0, 6, 0, 0.3), tree(1, 3, 0.10, 0.05), tree(2, 3.2, 0.02, 0.06)};
  EXPECT_EQ(trunkVisibility(most, still, kForward, PinholeCamera())[0].frames, 0u);
}

/// Runs made up from the true flight: moved in the plane, and by another clock.
class RunAgainst : public testing::Test
{
protected:
  static constexpr const char *kFlight = BOLE_SOURCE_DIR "/data/park-forward";

  std::string writeRun(const std::string &name, double metres_off, std::int64_t ns_off,
                       const std::vector<TrunkRecord> &map) const
  {
    const std::string folder = testing::TempDir() + "bole_evaluate_" + name;
    std::filesystem::create_directories(folder);
    const AslSource source(kFlight);
    Trajectory run;
    for (const std::int64_t stamp_ns : source.stamps())
      if (const auto wMb = interpolate(source.truth(), stamp_ns)) {
        run.push_back({stamp_ns + ns_off, *wMb});
        run.back().wMb.t.x() += metres_off;
      }
    writeTrajectory(folder + "/trajectory.tum", run);
    writeTrunks(folder + "/trunks.csv", map);
    return folder;
  }
};

TEST_F(RunAgainst, TheClockOfALiveRunIsFoundByItsMotionWhenAsked)
{
  // another clock, another place, and the first three frames were lost
  const std::string run = writeRun("live", 3, 100'037'000'000, {});
  Trajectory late = readTumTrajectory(run + "/trajectory.tum");
  late.erase(late.begin(), late.begin() + 3);
  writeTrajectory(run + "/trajectory.tum", late);
  EXPECT_THROW(evaluate(run, kFlight), vpException);
  const Evaluation evaluation = evaluate(run, kFlight, true);
  ASSERT_TRUE(evaluation.time_shift_s);
  EXPECT_NEAR(*evaluation.time_shift_s, -100.037, 0.0011);
  EXPECT_EQ(evaluation.smoothed.absolute[0].poses, late.size());
  EXPECT_LT(evaluation.smoothed.absolute[2].ate, 3e-3);
}

TEST_F(RunAgainst, ARunInWhichNothingMatchedShowsNoErrorOfZero)
{
  const Evaluation evaluation = evaluate(writeRun("nothing", 0, 0, {confirmed(1, 500, 500)}), kFlight);
  const std::string table = toTable(evaluation, true);
  EXPECT_THAT(table, testing::HasSubstr("recall 0.0 % (0 of 10)   precision 0.0 % (0 of 1)"));
  EXPECT_THAT(table, testing::ContainsRegex("aligned x, y, yaw +- +-\n"));
  const auto json = nlohmann::json::parse(toJson(evaluation));
  EXPECT_TRUE(json.at("trunks").at("all").at("position_m").at("xy_yaw").at("rmse").is_null());
  EXPECT_TRUE(json.at("trunks").at("all").at("nees_half").is_null());
  EXPECT_TRUE(json.at("trunks").at("by_range").at("0 to 2 m").at("radius_m").at("bias").is_null());
  EXPECT_EQ(json.at("trunks").at("recall"), 0);
}

TEST_F(RunAgainst, ARunThatStoodStillHasNoScale)
{
  const std::string run = writeRun("still", 0, 0, {});
  Trajectory still = readTumTrajectory(run + "/trajectory.tum");
  for (StampedPose &pose : still)
    pose.wMb.t.setZero();
  writeTrajectory(run + "/trajectory.tum", still);
  EXPECT_TRUE(std::isnan(evaluate(run, kFlight).smoothed.scale));
}

TEST_F(RunAgainst, AnotherRunStandsForTheTruth)
{
  TrunkRecord candidate = confirmed(3, 9, 9);
  candidate.status = TrunkStatus::candidate;
  const std::string one = writeRun("one", 0, 0, {confirmed(1, 5, 1, 0.2), confirmed(2, 7, -2, 0.3), candidate});
  const std::string other = writeRun("other", 2, 0, {confirmed(7, 7.1, 1, 0.25), confirmed(8, 20, 4)});
  const Evaluation evaluation = evaluate(other, one);
  EXPECT_TRUE(evaluation.is_against_run);
  ASSERT_TRUE(evaluation.trunks);
  EXPECT_DOUBLE_EQ(evaluation.trunks->recall, 0.5); // of its two confirmed trunks
  EXPECT_DOUBLE_EQ(evaluation.trunks->precision, 0.5);
  EXPECT_NEAR(evaluation.trunks->all.median[2], 0.1, 1e-4); // after the shift by 2 m
  EXPECT_NEAR(evaluation.trunks->all.radius_rmse, 0.05, 1e-4);
  EXPECT_NEAR(evaluation.smoothed.absolute[0].ate, 2, 1e-4);
  EXPECT_NEAR(evaluation.smoothed.absolute[2].ate, 0, 1e-4);
}

// What `bole evaluate` says of two trajectory.tum is what evo (github.com/MichaelGrupp/evo, not in Debian) says of
// them, by its formulas as they stand in evo/core/metrics.py:
//   APE  E_i = P_ref,i^-1 P_est,i                                    translation |t(E_i)|, rotation angle of R(E_i)
//   RPE  E_i = (P_ref,i^-1 P_ref,i+d)^-1 (P_est,i^-1 P_est,i+d)      the same parts; both as RMSE over i
namespace
{
/// "t tx ty tz qx qy qz qw" a line, as evo's file_interface reads it.
std::vector<Eigen::Matrix4d> readAsEvoDoes(const std::string &path)
{
  std::vector<Eigen::Matrix4d> poses;
  for (const std::string &line : test::linesOf(path)) {
    if (line.empty() || line[0] == '#')
      continue;
    double stamp, tx, ty, tz, qx, qy, qz, qw;
    std::istringstream(line) >> stamp >> tx >> ty >> tz >> qx >> qy >> qz >> qw;
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    pose.topLeftCorner<3, 3>() = Eigen::Quaterniond(qw, qx, qy, qz).normalized().toRotationMatrix();
    pose.topRightCorner<3, 1>() = Eigen::Vector3d(tx, ty, tz);
    poses.push_back(pose);
  }
  return poses;
}

/// RMSE of translation [m] and rotation [degrees] of \p errors.
std::pair<double, double> rmseOf(const std::vector<Eigen::Matrix4d> &errors)
{
  double translation = 0, rotation = 0;
  for (const Eigen::Matrix4d &E : errors) {
    translation += E.topRightCorner<3, 1>().squaredNorm();
    rotation += std::pow(Eigen::AngleAxisd(Eigen::Matrix3d(E.topLeftCorner<3, 3>())).angle() * 180 / M_PI, 2);
  }
  const double n = static_cast<double>(errors.size());
  return {std::sqrt(translation / n), std::sqrt(rotation / n)};
}
} // namespace

TEST(TrajectoryMetrics, AgreeWithEvosFormulasToABillionth)
{
  constexpr std::size_t kApart = 5; // frames, of an interval
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 0.05);
  Trajectory truth, estimate;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Quaterniond q =
        Eigen::AngleAxisd(0.05 * i, Eigen::Vector3d(0.1, -0.2, 1).normalized()) * Eigen::Quaterniond::Identity();
    truth.push_back({i * 100000000LL, Pose(q.toRotationMatrix(), {0.1 * i, std::sin(0.1 * i), 1.2})});
    const Eigen::Vector3d turn(noise(random), noise(random), noise(random)), move(noise(random), noise(random), 0.02);
    estimate.push_back(
        {i * 100000000LL,
         Pose((q * Eigen::AngleAxisd(turn.norm(), turn.normalized())).toRotationMatrix(), truth.back().wMb.t + move)});
  }
  const test::TemporaryFolder folder;
  writeTrajectory(folder / "truth.tum", truth);
  writeTrajectory(folder / "estimate.tum", estimate);

  const auto reference = readAsEvoDoes(folder / "truth.tum"), tested = readAsEvoDoes(folder / "estimate.tum");
  ASSERT_EQ(reference.size(), 60u);
  std::vector<Eigen::Matrix4d> ape, rpe;
  double squares_xy = 0;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    ape.emplace_back(reference[i].inverse() * tested[i]);
    squares_xy += (tested[i] - reference[i]).topRightCorner<2, 1>().squaredNorm();
  }
  for (std::size_t i = 0; i + kApart < reference.size(); ++i)
    rpe.emplace_back((reference[i].inverse() * reference[i + kApart]).inverse() *
                     (tested[i].inverse() * tested[i + kApart]));

  const auto pairs = pairPoses(readTumTrajectory(folder / "estimate.tum"), readTumTrajectory(folder / "truth.tum"));
  const TrajectoryErrors absolute = absoluteErrors(pairs, align(pairs, Alignment::none));
  const RelativeErrors relative = relativeErrors(pairs, 0.1 * kApart);
  EXPECT_NEAR(absolute.ate, rmseOf(ape).first, 1e-9);
  EXPECT_NEAR(absolute.ate_xy, std::sqrt(squares_xy / 60), 1e-9);
  EXPECT_NEAR(absolute.rotation_deg, rmseOf(ape).second, 1e-6); // [degrees]: the quaternions have nine digits
  EXPECT_EQ(relative.intervals, 60 - kApart);
  EXPECT_NEAR(relative.translation, rmseOf(rpe).first, 1e-9);
  EXPECT_NEAR(relative.rotation_deg, rmseOf(rpe).second, 1e-6);
}
