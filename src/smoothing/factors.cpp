// SPDX-License-Identifier: GPL-2.0-or-later
#include "smoothing/factors.h"
#include "geometry/failure.h"
#include "geometry/names.h"
#include "geometry/so3.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include <cmath>

namespace bole
{
using Eigen::Matrix3d;
using Eigen::Vector3d;

template <int N>
Eigen::Matrix<double, N, N> squareRootInformation(const Eigen::Matrix<double, N, N> &covariance, const char *name)
{
  using Square = Eigen::Matrix<double, N, N>;
  const Eigen::LLT<Square> factor(covariance);
  const bool usable =
      covariance.allFinite() && factor.info() == Eigen::Success &&
      (covariance - covariance.transpose()).cwiseAbs().maxCoeff() <= 1e-6 * covariance.cwiseAbs().maxCoeff();
  Square S = Square::Identity();
  if (usable)
    factor.matrixL().solveInPlace(S);
  if (!usable || !S.allFinite())
    throw badValue("{}, must be finite, symmetric and positive definite", name);
  return S;
}
template Matrix6d squareRootInformation<6>(const Matrix6d &, const char *);
template Matrix5d squareRootInformation<5>(const Matrix5d &, const char *);
template Eigen::Matrix3d squareRootInformation<3>(const Eigen::Matrix3d &, const char *);

Vector6d residual(const PosePrior &prior, const Matrix6d &S, const Pose &wMb, Matrix6d *J)
{
  const Vector6d xi = wMb.minus(prior.mean);
  if (J) {
    Matrix6d D = Matrix6d::Zero();
    D.topLeftCorner<3, 3>() = prior.mean.R.transpose() * wMb.R;
    D.bottomRightCorner<3, 3>() = inverseRightJacobianSo3(xi.tail<3>());
    J->noalias() = S * D;
  }
  return S * xi;
}

Vector6d residual(const Odometry &odometry, const Matrix6d &S, const Pose &wMa, const Pose &wMb, Matrix6d *J_a,
                  Matrix6d *J_b)
{
  const Pose aMb = wMa.inverse() * wMb;
  const Vector6d xi = aMb.minus(odometry.aMb);
  const Matrix3d Rm = odometry.aMb.R.transpose();
  const Matrix3d Jr_inverse = inverseRightJacobianSo3(xi.tail<3>());
  Matrix6d D;
  if (J_a) {
    D.topLeftCorner<3, 3>() = -Rm;
    D.topRightCorner<3, 3>() = Rm * skew(aMb.t);
    D.bottomLeftCorner<3, 3>().setZero();
    D.bottomRightCorner<3, 3>() = -Jr_inverse * aMb.R.transpose();
    J_a->noalias() = S * D;
  }
  if (J_b) {
    D.setZero();
    D.topLeftCorner<3, 3>() = Rm * aMb.R;
    D.bottomRightCorner<3, 3>() = Jr_inverse;
    J_b->noalias() = S * D;
  }
  return S * xi;
}

Vector5d residual(const RelativePoseMeasurement &measurement, const Matrix5d &S, const Pose &bMc, const Pose &wMa,
                  const Pose &wMb, Matrix56d *J_a, Matrix56d *J_b)
{
  const Matrix3d cRb = bMc.R.transpose();
  const Matrix3d bRa = wMb.R.transpose() * wMa.R;
  const Matrix3d caRcb = cRb * bRa.transpose() * bMc.R;
  const Vector3d from_a = wMa.R.transpose() * (wMb * bMc.t - wMa.t); // centre of camera b in body a
  const Vector3d t = cRb * (from_a - bMc.t);
  const double length = t.norm();

  Vector5d e = Vector5d::Zero();
  e.head<3>() = logSo3(measurement.caRcb.transpose() * caRcb);
  Eigen::Matrix<double, 2, 3> J_t = Eigen::Matrix<double, 2, 3>::Zero();
  if (length > kMinBaseline) {
    const Vector3d u = t / length;
    const auto basis = directionBasis(measurement.direction);
    const Eigen::Vector2d in_plane = basis.transpose() * u;
    const double sine = in_plane.norm(), cosine = measurement.direction.dot(u);
    const double angle = std::atan2(sine, cosine);
    const double stretch = sine > 1e-6 ? angle / sine : 1; // log map of the sphere
    e.tail<2>() = stretch * in_plane;
    Eigen::Matrix<double, 2, 3> J_u = stretch * basis.transpose();
    if (sine > 1e-6) { // d(angle / sine): in_plane and cosine move with u
      const Eigen::Vector2d along = in_plane / sine;
      const double by_sine = cosine / sine - angle / (sine * sine);
      J_u += in_plane * (by_sine * along.transpose() * basis.transpose() - measurement.direction.transpose());
    }
    J_t = J_u * (Matrix3d::Identity() - u * u.transpose()) / length;
  }
  if (J_a || J_b) {
    const Matrix3d Jr_inverse = inverseRightJacobianSo3(e.head<3>());
    Matrix56d D = Matrix56d::Zero();
    if (J_a) {
      D.topRightCorner<3, 3>() = -Jr_inverse * cRb * bRa;
      D.bottomLeftCorner<2, 3>() = -J_t * cRb;
      D.bottomRightCorner<2, 3>() = J_t * cRb * skew(from_a);
      J_a->noalias() = S * D;
    }
    if (J_b) {
      D.setZero();
      D.topRightCorner<3, 3>() = Jr_inverse * cRb;
      D.bottomLeftCorner<2, 3>() = J_t * cRb * bRa.transpose();
      D.bottomRightCorner<2, 3>() = -J_t * cRb * bRa.transpose() * skew(bMc.t);
      J_b->noalias() = S * D;
    }
  }
  return S * e;
}

Vector5d residual(const TrunkPrior &prior, const Trunk &trunk)
{
  return trunk.minus(prior.mean).cwiseQuotient(prior.sigma);
}

Vector4d residual(const SquareRootSummary &summary, const Pose &bMc, const Pose &wMb, const Trunk &trunk,
                  Matrix46d *J_pose, Matrix45d *J_trunk)
{
  const RelativeTrunk relative = relativeTrunk(wMb, bMc, trunk, J_pose, J_trunk);
  Matrix4d J;
  const Vector4d r = summary.residual(relative, J_pose || J_trunk ? &J : nullptr);
  if (!r.allFinite() || (J_pose && !J_pose->allFinite()) || (J_trunk && !J_trunk->allFinite())) {
    if (J_pose)
      J_pose->setZero();
    if (J_trunk)
      J_trunk->setZero();
    return Vector4d::Zero();
  }
  if (J_pose)
    *J_pose = (J * *J_pose).eval();
  if (J_trunk)
    *J_trunk = (J * *J_trunk).eval();
  return r;
}

const char *toString(LossKind kind) { return nameOf(kind, {"quadratic", "huber", "cauchy"}); }

LossKind lossKindFromString(const std::string &name)
{
  if (const auto kind = valueNamed(name, LossKind::cauchy))
    return *kind;
  throw badValue("loss = {}, must be quadratic, huber or cauchy", name);
}

double Loss::rho(double s) const
{
  const double w2 = width * width;
  if (kind == LossKind::huber && s > w2)
    return 2 * width * std::sqrt(s) - w2;
  if (kind == LossKind::cauchy)
    return w2 * std::log1p(s / w2);
  return s;
}

double Loss::weight(double s) const
{
  const double w2 = width * width;
  if (kind == LossKind::huber && s > w2)
    return width / std::sqrt(s);
  if (kind == LossKind::cauchy)
    return 1 / (1 + s / w2);
  return 1;
}
} // namespace bole
