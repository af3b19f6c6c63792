// SPDX-License-Identifier: GPL-2.0-or-later
// What `bole evaluate` says of two trajectory.tum is what evo (github.com/MichaelGrupp/evo, not in Debian) says of
// them, by its formulas as they stand in evo/core/metrics.py:
//   APE  E_i = P_ref,i^-1 P_est,i                                    translation |t(E_i)|, rotation angle of R(E_i)
//   RPE  E_i = (P_ref,i^-1 P_ref,i+1)^-1 (P_est,i^-1 P_est,i+1)      the same parts; both as RMSE over i
#include "evaluation/trajectory_metrics.h"
#include "input/trajectory.h"

#include <Eigen/Geometry>
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

namespace
{
using namespace bole;

/// "t tx ty tz qx qy qz qw" a line, as evo's file_interface reads it.
std::vector<Eigen::Matrix4d> readAsEvoDoes(const std::string &path)
{
  std::vector<Eigen::Matrix4d> poses;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
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
  std::string folder = (std::filesystem::temp_directory_path() / "bole-evo-XXXXXX").string();
  folder = mkdtemp(folder.data());
  writeTrajectory(folder + "/truth.tum", truth);
  writeTrajectory(folder + "/estimate.tum", estimate);

  const auto reference = readAsEvoDoes(folder + "/truth.tum"), tested = readAsEvoDoes(folder + "/estimate.tum");
  ASSERT_EQ(reference.size(), 60u);
  std::vector<Eigen::Matrix4d> ape, rpe;
  for (std::size_t i = 0; i < reference.size(); ++i)
    ape.emplace_back(reference[i].inverse() * tested[i]);
  for (std::size_t i = 0; i + 1 < reference.size(); ++i)
    rpe.emplace_back((reference[i].inverse() * reference[i + 1]).inverse() * (tested[i].inverse() * tested[i + 1]));

  const auto pairs = pairPoses(readTumTrajectory(folder + "/estimate.tum"), readTumTrajectory(folder + "/truth.tum"));
  std::filesystem::remove_all(folder);
  const TrajectoryErrors absolute = absoluteErrors(pairs, align(pairs, Alignment::none));
  const RelativeErrors relative = relativeErrors(pairs, 0.1);
  EXPECT_NEAR(absolute.ate, rmseOf(ape).first, 1e-9);
  EXPECT_NEAR(absolute.rotation_deg, rmseOf(ape).second, 1e-6); // [degrees]: the quaternions have nine digits
  EXPECT_EQ(relative.intervals, 59u);
  EXPECT_NEAR(relative.translation, rmseOf(rpe).first, 1e-9);
  EXPECT_NEAR(relative.rotation_deg, rmseOf(rpe).second, 1e-6);
}
