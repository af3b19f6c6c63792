// SPDX-License-Identifier: GPL-2.0-or-later
#include "mbt/border_vote.h"

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>

namespace bole
{
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace
{
float at(const std::vector<float> &response, double offset)
{
  const int half = int(response.size()) / 2, k = int(std::lround(offset)) + half;
  return k < 0 || k >= int(response.size()) ? 0.f : response[std::size_t(k)];
}
} // namespace

Vote vote(const std::vector<BallotBorder> &borders, const Matrix6d &covariance, const VoteOptions &options)
{
  Vote best;
  if (borders.empty())
    return best;
  const Matrix6d root = Eigen::LLT<Matrix6d>(covariance).matrixL();
  MatrixXd M(int(borders.size()), 6);
  for (int b = 0; b < M.rows(); ++b)
    M.row(b) = borders[std::size_t(b)].offset_by_twist * root;
  const Eigen::JacobiSVD<MatrixXd> svd(M, Eigen::ComputeThinV);
  const int modes = std::min<int>(3, int(svd.matrixV().cols()));
  const MatrixXd V = svd.matrixV().leftCols(modes), moves = M * V;

  std::array<int, 3> half{{0, 0, 0}};
  std::array<double, 3> step{{0, 0, 0}};
  double poses = 1;
  for (int i = 0; i < modes; ++i) {
    const double most = moves.col(i).cwiseAbs().maxCoeff();
    step[std::size_t(i)] = std::max(options.step_px / std::max(most, 1e-9), 0.25);
    half[std::size_t(i)] = int(options.sigmas / step[std::size_t(i)]);
    poses *= 2 * half[std::size_t(i)] + 1;
  }
  while (poses > options.max_poses) { // coarsen the widest
    const std::size_t widest = std::size_t(std::max_element(half.begin(), half.end()) - half.begin());
    poses /= 2 * half[widest] + 1;
    step[widest] *= 1.5;
    half[widest] = int(options.sigmas / step[widest]);
    poses *= 2 * half[widest] + 1;
  }

  double best_value = -1e300;
  Eigen::Vector3d best_z = Eigen::Vector3d::Zero();
  const auto value = [&](const Eigen::Vector3d &z, double &hits) {
    const VectorXd offsets = moves * z.head(modes);
    float sum = 0;
    for (int b = 0; b < offsets.size(); ++b)
      sum += at(borders[std::size_t(b)].response, offsets(b));
    hits = double(sum);
    return options.weight * hits - 0.5 * z.squaredNorm();
  };
  for (int i = -half[0]; i <= half[0]; ++i)
    for (int j = -half[1]; j <= half[1]; ++j)
      for (int k = -half[2]; k <= half[2]; ++k) {
        const Eigen::Vector3d z(i * step[0], j * step[1], k * step[2]);
        double hits = 0;
        const double v = value(z, hits);
        if (v > best_value) {
          best_value = v;
          best_z = z;
          best.score = hits / double(borders.size());
        }
      }
  best.twist = root * (V * best_z.head(modes));
  return best;
}
} // namespace bole
