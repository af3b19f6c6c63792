// SPDX-License-Identifier: GPL-2.0-or-later
// The virtual visual servoing of vpMbTrunkTracker: from found places to a pose and its covariance.
#include "mbt/camera_twist.h"
#include "tracking/borders.h"

#include <bole/vpMbTrunkTracker.h>

#include <Eigen/Dense>

using bole::Border;
using bole::inverted;
using bole::kBorders;
using bole::Matrix6d;
using bole::moved;
using bole::Pose;
using bole::twistBetween;
using bole::twistMatrix;
using bole::Vector6d;
using Eigen::Matrix3d;
using Eigen::MatrixXd;

namespace
{
using Matrix9d = Eigen::Matrix<double, 9, 9>;
using Vector9d = Eigen::Matrix<double, 9, 1>;
} // namespace

Matrix6d vpMbTrunkTracker::estimatedInObject() const
{
  Matrix6d J;
  for (unsigned i = 0; i < 6; ++i)
    for (unsigned j = 0; j < 6; ++j)
      J(int(i), int(j)) = oJo[i][j];
  return J;
}

/// The part of the camera's twist \p xi that lies in the degrees of freedom to be estimated.
Vector6d vpMbTrunkTracker::estimated(const Vector6d &xi) const
{
  const Matrix6d J = estimatedInObject();
  if (J.isIdentity(0))
    return xi;
  const Matrix6d V = twistMatrix(m_cMo);
  return V * J * V.inverse() * xi;
}

void vpMbTrunkTracker::computeVVSInit()
{
  unsigned int n = 0;
  for (std::size_t k : m_in_view) {
    m_trunks[k].initInteractionMatrixError();
    n += m_trunks[k].nbFeature;
  }
  m_L.resize(n, 6, false, false);
  m_error.resize(n, false);
  m_w.resize(n, false);
  m_w = 1;
  m_piece_weight.resize(n, false);
  m_by_log_radius.resize(n, false);
}

void vpMbTrunkTracker::computeVVSInteractionMatrixAndResidu()
{
  unsigned int at = 0;
  for (std::size_t k : m_in_view) {
    vpMbtDistanceTrunk &trunk = m_trunks[k];
    trunk.computeInteractionMatrixError(m_cMo);
    for (unsigned int i = 0; i < trunk.nbFeature; ++i, ++at) {
      for (unsigned int c = 0; c < 6; ++c)
        m_L[at][c] = trunk.L[i][c];
      m_error[at] = trunk.error[i];
      m_piece_weight[at] = trunk.weight[i];
      m_by_log_radius[at] = trunk.by_log_radius[i];
    }
  }
}

void vpMbTrunkTracker::normalEquations(Matrix6d &H, Vector6d &b) const
{
  H.setZero();
  b.setZero();
  const double scale = std::pow(focal() / m_options.border_sigma_px, 2);
  unsigned int at = 0;
  for (std::size_t k : m_in_view) {
    const vpMbtDistanceTrunk &trunk = m_trunks[k];
    if (trunk.nbFeature == 0)
      continue;
    // the lean of the real trunk about its foot and its width are not those of the model: three unknowns beside the
    // six of the camera, with a prior, eliminated
    const bole::Cylinder c = Pose::fromVisp(m_cMo) * trunk.object();
    const Matrix3d cRt = bole::relativeTrunk(c).cRt;
    Eigen::Matrix<double, 6, 2> lean;
    for (int i = 0; i < 2; ++i)
      lean.col(i) << cRt.col(i).cross(c.foot), -cRt.col(i);
    Matrix9d A = Matrix9d::Zero();
    Vector9d g = Vector9d::Zero(), row;
    for (unsigned int i = 0; i < trunk.nbFeature; ++i, ++at) {
      const Eigen::Map<const Vector6d> l(m_L[at]);
      row << l, lean.transpose() * l, m_by_log_radius[at];
      const double weight = scale * m_w[at] * m_piece_weight[at];
      A.noalias() += weight * row * row.transpose();
      g -= weight * m_error[at] * row;
    }
    A(6, 6) += 1 / (m_options.lean_sigma_rad * m_options.lean_sigma_rad);
    A(7, 7) += 1 / (m_options.lean_sigma_rad * m_options.lean_sigma_rad);
    A(8, 8) += 1 / (m_options.radius_sigma * m_options.radius_sigma);
    const Eigen::Matrix<double, 6, 3> gain = A.topRightCorner<6, 3>() * A.bottomRightCorner<3, 3>().inverse();
    H += A.topLeftCorner<6, 6>() - gain * A.bottomLeftCorner<3, 6>();
    b += g.head<6>() - gain * g.tail<3>();
  }
}

void vpMbTrunkTracker::servo(const Prediction &prediction)
{
  computeVVSInit();
  m_robust.setMinMedianAbsoluteDeviation(m_options.border_sigma_px / 1.48 / focal());
  const Matrix6d prior_information = inverted(prediction.covariance);
  for (unsigned int iteration = 0; iteration < m_maxIter; ++iteration) {
    computeVVSInteractionMatrixAndResidu();
    if (m_error.size() > 0)
      computeVVSWeights(m_robust, m_error, m_w);
    Matrix6d H;
    Vector6d b;
    normalEquations(H, b);
    H += prior_information;
    b += prior_information * twistBetween(m_cMo, prediction.cMo);
    Vector6d xi;
    if (estimatedInObject().isIdentity(0))
      xi = inverted(H) * b;
    else { // only the estimated degrees of freedom, given in the object frame
      const Matrix6d VJ = twistMatrix(m_cMo) * estimatedInObject();
      const MatrixXd HJ = VJ.transpose() * H * VJ;
      xi = VJ * HJ.completeOrthogonalDecomposition().solve(VJ.transpose() * b);
    }
    if (!xi.allFinite())
      break;
    m_cMo = moved(m_cMo, m_lambda * xi);
    if (xi.norm() < 1e-5)
      break;
  }
  computeVVSInteractionMatrixAndResidu();
}

double vpMbTrunkTracker::support() const
{
  double visible = 0, agree = 0;
  unsigned int at = 0;
  for (std::size_t k : m_in_view)
    for (Border side : kBorders) {
      const auto &state = m_trunks[k].border(side);
      if (!state.visible)
        continue;
      visible += 1;
      for (const auto &piece : state.pieces)
        if (piece.used)
          agree += m_piece_weight[at] * m_w[at], ++at;
    }
  return visible > 0 ? agree / visible : 0;
}

void vpMbTrunkTracker::keep(const Prediction &prediction)
{
  Matrix6d H;
  Vector6d b;
  normalEquations(H, b);
  m_posterior = inverted(inverted(prediction.covariance) + H);
  m_posterior = 0.5 * (m_posterior + m_posterior.transpose()).eval();
  Matrix6d S = Matrix6d::Identity();
  S.diagonal().tail<3>().setConstant(1 / m_options.lever_m);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(S * H * S);
  int unobserved = 0;
  while (unobserved < 6 && eigen.eigenvalues()(unobserved) * m_options.unobserved_m * m_options.unobserved_m < 1)
    ++unobserved;
  m_unobserved = eigen.eigenvectors().leftCols(unobserved);
}
