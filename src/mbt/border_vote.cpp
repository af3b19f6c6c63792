// SPDX-License-Identifier: GPL-2.0-or-later
#include "mbt/pose_estimator.h"

#include <Eigen/Dense>

#include <algorithm>
#include <array>

namespace bole
{
using Eigen::MatrixXd;
using Eigen::Vector3d;

namespace
{
constexpr double kWeight = 2;    ///< log-likelihood of a full response against none
constexpr double kStep_px = 1.5; ///< of the grid, at the border that moves most
constexpr double kSigmas = 3;    ///< half-width of the grid
constexpr double kMaxPoses = 6000;

struct Axis
{
  int half = 0;
  double step = 0; ///< [standard deviations]
};

/// A grid over the modes, coarsened along its widest axis until it has at most kMaxPoses points.
std::array<Axis, 3> gridFor(const MatrixXd &moves)
{
  std::array<Axis, 3> axes;
  for (int i = 0; i < moves.cols(); ++i) {
    axes[std::size_t(i)].step = std::max(kStep_px / std::max(moves.col(i).cwiseAbs().maxCoeff(), 1e-9), 0.25);
    axes[std::size_t(i)].half = int(kSigmas / axes[std::size_t(i)].step);
  }
  const auto points = [&] { return (2. * axes[0].half + 1) * (2. * axes[1].half + 1) * (2. * axes[2].half + 1); };
  while (points() > kMaxPoses) {
    Axis &widest =
        *std::max_element(axes.begin(), axes.end(), [](const Axis &a, const Axis &b) { return a.half < b.half; });
    widest.step *= 1.5;
    widest.half = int(kSigmas / widest.step);
  }
  return axes;
}
} // namespace

Vote vote(const std::vector<BallotBorder> &borders, const Matrix6d &covariance)
{
  Vote best;
  if (borders.empty())
    return best;
  const int n = int(borders.size());
  const Matrix6d root = Eigen::LLT<Matrix6d>(covariance).matrixL();
  MatrixXd M(n, 6);
  for (int b = 0; b < n; ++b)
    M.row(b) = borders[std::size_t(b)].offset_by_twist * root;
  // the directions that move the borders most: the greatest eigenvectors of M^T M
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(Matrix6d(M.transpose() * M));
  const Eigen::Matrix<double, 6, 3> V = eigen.eigenvectors().rightCols<3>().rowwise().reverse();
  const Eigen::Matrix<double, Eigen::Dynamic, 3> moves = M * V;
  const std::array<Axis, 3> axes = gridFor(moves);

  double best_value = -1e300;
  Vector3d best_z = Vector3d::Zero();
  Eigen::VectorXd base(n);
  for (int i = -axes[0].half; i <= axes[0].half; ++i)
    for (int j = -axes[1].half; j <= axes[1].half; ++j) {
      for (int b = 0; b < n; ++b) // 0.5: to round by cutting off
        base(b) = i * axes[0].step * moves(b, 0) + j * axes[1].step * moves(b, 1) +
                  double(borders[std::size_t(b)].response.size() / 2) + 0.5;
      for (int k = -axes[2].half; k <= axes[2].half; ++k) {
        const Vector3d z(i * axes[0].step, j * axes[1].step, k * axes[2].step);
        float hits = 0;
        for (int b = 0; b < n; ++b) {
          const std::vector<float> &response = borders[std::size_t(b)].response;
          const double at = base(b) + z.z() * moves(b, 2);
          if (at >= 0 && at < double(response.size()))
            hits += response[std::size_t(at)];
        }
        const double value = kWeight * double(hits) - 0.5 * z.squaredNorm();
        if (value > best_value)
          best_value = value, best_z = z, best.score = double(hits) / n;
      }
    }
  best.twist = root * (V * best_z);
  return best;
}
} // namespace bole
