// SPDX-License-Identifier: GPL-2.0-or-later
// The virtual visual servoing of PoseEstimator: from found places to a pose and its information.
#include "mbt/pose_estimator.h"

#include "geometry/median.h"
#include "geometry/so3.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace bole
{
using Eigen::Matrix3d;

namespace
{
using Matrix9d = Eigen::Matrix<double, 9, 9>;
using Vector9d = Eigen::Matrix<double, 9, 1>;

constexpr double kTukey = 4.6851;   ///< 95 % efficiency
constexpr double kConverged = 1e-4; ///< norm of the last step, m and rad
} // namespace

Pose movedBy(const Pose &cMo, const Vector6d &xi)
{
  return Pose(orthonormalized(expSo3(-xi.tail<3>())), -xi.head<3>()) * cMo;
}

Vector6d twistBetween(const Pose &from, const Pose &to)
{
  const Pose moved = to * from.inverse();
  Vector6d xi;
  xi << -moved.t, -logSo3(moved.R);
  return xi;
}

/// The part of the camera's twist \p xi that lies in the degrees of freedom to be estimated.
Vector6d PoseEstimator::freePart(const Vector6d &xi) const
{
  if (is_all_free)
    return xi;
  const Matrix6d V = adjoint(m_pose);
  return V * free_in_object * adjoint(m_pose.inverse()) * xi;
}

void PoseEstimator::linearise()
{
  for (const std::size_t k : m_in_view)
    trunks[k].linearise(m_pose);
}

/// Tukey's weights; the scale is the median of the residuals, at least the roughness of a border.
void PoseEstimator::weigh(double focal_px)
{
  std::vector<double> sizes;
  sizes.reserve(2 * kPieces * m_in_view.size());
  forEachPiece([&](const FoundPiece &piece, const ModelBorder &) { sizes.push_back(std::abs(piece.residual)); });
  if (sizes.empty())
    return;
  const double limit =
      kTukey * std::max(1.4826 * medianOf(std::move(sizes)), options.border_sigma_px / 1.48 / focal_px);
  for (const std::size_t k : m_in_view)
    for (ModelBorder &border : trunks[k].borders())
      for (FoundPiece &piece : border.pieces) {
        const double x = piece.residual / limit;
        piece.robust = std::abs(x) < 1 ? (1 - x * x) * (1 - x * x) : 0;
      }
}

PoseEstimator::Normal PoseEstimator::normalEquations(double focal_px) const
{
  Normal sum;
  const double scale = std::pow(focal_px / options.border_sigma_px, 2);
  for (const std::size_t k : m_in_view) {
    // The lean of the real trunk about its foot and its width are not those of the model: three unknowns beside the six
    // of the camera. They have a prior and are eliminated.
    const ModelTrunk &trunk = trunks[k];
    const Matrix3d &cRt = trunk.relative().cRt;
    Eigen::Matrix<double, 6, 2> lean;
    for (int i = 0; i < 2; ++i)
      lean.col(i) << cRt.col(i).cross(trunk.inCamera().foot), -cRt.col(i);
    Matrix9d A = Matrix9d::Zero();
    Vector9d g = Vector9d::Zero(), row;
    bool is_empty = true;
    for (const ModelBorder &border : trunk.borders())
      for (const FoundPiece &piece : border.pieces) {
        if (border.chosen < 0 || !piece.used || piece.robust <= 0)
          continue;
        row << piece.by_twist.transpose(), (piece.by_twist * lean).transpose(), piece.by_log_radius;
        const double weight = scale * piece.robust * piece.share;
        A.noalias() += (weight * row) * row.transpose();
        g -= weight * piece.residual * row;
        is_empty = false;
      }
    if (is_empty)
      continue;
    A(6, 6) += 1 / (options.lean_sigma_rad * options.lean_sigma_rad);
    A(7, 7) += 1 / (options.lean_sigma_rad * options.lean_sigma_rad);
    A(8, 8) += 1 / (options.radius_sigma * options.radius_sigma);
    const Eigen::Matrix<double, 6, 3> eliminate = A.topRightCorner<6, 3>() * A.bottomRightCorner<3, 3>().inverse();
    sum.H += A.topLeftCorner<6, 6>() - eliminate * A.bottomLeftCorner<3, 6>();
    sum.b += g.head<6>() - eliminate * g.tail<3>();
  }
  return sum;
}

void PoseEstimator::servo(const ExpectedPose &expected, double focal_px)
{
  const Matrix6d prior_information = expected.covariance.llt().solve(Matrix6d::Identity());
  for (int iteration = 0; iteration < iterations; ++iteration) {
    linearise();
    weigh(focal_px);
    Normal normal = normalEquations(focal_px);
    normal.H += prior_information;
    normal.b += prior_information * twistBetween(m_pose, expected.cMo);
    Vector6d xi;
    if (is_all_free)
      xi = normal.H.llt().solve(normal.b);
    else { // only the degrees of freedom to be estimated, which are given in the object frame
      const Matrix6d VJ = adjoint(m_pose) * free_in_object;
      const Eigen::MatrixXd HJ = VJ.transpose() * normal.H * VJ;
      xi = VJ * HJ.completeOrthogonalDecomposition().solve(VJ.transpose() * normal.b);
    }
    if (!xi.allFinite())
      break;
    m_pose = movedBy(m_pose, gain * xi);
    if (xi.norm() < kConverged)
      break;
  }
  linearise();
  m_information = normalEquations(focal_px).H;
}

/// Share of the visible borders whose places agree with the pose.
double PoseEstimator::support() const
{
  double visible = 0, agree = 0;
  for (const std::size_t k : m_in_view)
    for (const ModelBorder &border : trunks[k].borders())
      visible += border.visible ? 1 : 0;
  forEachPiece([&](const FoundPiece &piece, const ModelBorder &) { agree += piece.share * piece.robust; });
  return visible > 0 ? agree / visible : 0;
}
} // namespace bole
