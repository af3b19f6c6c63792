// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/so3.h"
#include "mbt/camera_motion.h"

#include <Eigen/Dense>
#include <gtest/gtest.h>

namespace
{
using namespace bole;
using Eigen::Matrix3d;
using Eigen::Vector3d;

const Vector3d kUp = Vector3d::UnitZ();
Matrix6d certain() { return Matrix6d::Identity() * 1e-8; }
/// A camera with the axes of the object, at \p o_position.
Pose at(const Vector3d &o_position) { return {Matrix3d::Identity(), -o_position}; }

TEST(CameraMotion, LearnsAVelocityAndThenExpectsTheCameraWhereItWillBe)
{
  const Vector3d velocity(0.1, -0.04, 0);
  CameraMotion motion;
  motion.start(at({1, 2, 3}), certain());
  const double sigma_at_first = std::sqrt(motion.predict(1, Matrix3d::Identity(), 1e-6, kUp).covariance(0, 0));
  for (int k = 1; k <= 5; ++k) {
    motion.predict(1, Matrix3d::Identity(), 1e-6, kUp);
    motion.update(at(Vector3d(1, 2, 3) + k * velocity), certain());
  }
  EXPECT_LT((motion.velocity() - velocity).norm(), 1e-4);
  const auto next = motion.predict(3, Matrix3d::Identity(), 1e-6, kUp);
  EXPECT_LT((next.cMo.inverse().t - Vector3d(1, 2, 3) - 8 * velocity).norm(), 1e-3);
  EXPECT_LT(std::sqrt(motion.predict(1, Matrix3d::Identity(), 1e-6, kUp).covariance(0, 0)), 0.5 * sigma_at_first);
}

TEST(CameraMotion, TurnsByWhatWasMeasuredAndGoesOnInTheObjectsFrame)
{
  const Matrix3d turn = expSo3({0.02, 0.3, -0.01});
  CameraMotion motion;
  motion.start(at({0, 0, 0}), certain());
  motion.replace(at({0.2, 0, 0}), certain(), 2);
  const auto next = motion.predict(1, turn, 0.01, kUp);
  EXPECT_LT((next.cMo.R - turn).norm(), 1e-12);
  EXPECT_LT((next.cMo.inverse().t - Vector3d(0.3, 0, 0)).norm(), 1e-12);
  EXPECT_NEAR(next.covariance(4, 4), 1e-4, 1e-7);
}

TEST(CameraMotion, DoesNotGoOnAlongWhatIsNeverSeen)
{
  CameraMotion::Options options;
  CameraMotion motion(options);
  motion.start(at({0, 0, 1}), certain());
  for (int k = 1; k <= 4; ++k) {
    motion.predict(1, Matrix3d::Identity(), 1e-6, kUp);
    motion.update(at({0.1 * k, 0, 1 + 0.05 * k}), certain());
  }
  const auto next = motion.predict(4, Matrix3d::Identity(), 1e-6, kUp);
  EXPECT_NEAR(next.cMo.inverse().t.z(), 1.2, 1e-9);
  EXPECT_NEAR(next.covariance(2, 2), 4 * options.climb_sigma_m * options.climb_sigma_m, 1e-6);
}

TEST(CameraMotion, AgreesWithAKalmanFilterOnPositionAndVelocity)
{
  using State = Eigen::Matrix<double, 6, 1>; // position and velocity
  const CameraMotion::Options options;
  const Matrix3d across = Matrix3d::Identity() - kUp * kUp.transpose();
  const Matrix3d measured = Vector3d(0.02, 0.05, 0.03).cwiseAbs2().asDiagonal();
  Eigen::Matrix<double, 6, 6> P = Eigen::Matrix<double, 6, 6>::Identity() * 1e-4;
  P.bottomRightCorner<3, 3>() = options.step_sigma_m * options.step_sigma_m * Matrix3d::Identity();
  State x = State::Zero();
  CameraMotion motion(options);
  Matrix6d start = Matrix6d::Identity() * 1e-4;
  motion.start(at(Vector3d::Zero()), start);
  const int gaps[] = {1, 1, 3, 1, 2};
  Vector3d truth = Vector3d::Zero();
  for (const int n : gaps) {
    Eigen::Matrix<double, 6, 6> F = Eigen::Matrix<double, 6, 6>::Zero(), Q = F;
    F << Matrix3d::Identity(), n * across, Matrix3d::Zero(), across;
    const Matrix3d change = n * options.accel_sigma_m * options.accel_sigma_m * across;
    Q << n * n * change + n * options.climb_sigma_m * options.climb_sigma_m * kUp * kUp.transpose(), n * change,
        n * change, change;
    x = F * x;
    P = F * P * F.transpose() + Q;
    const auto expected = motion.predict(n, Matrix3d::Identity(), 1e-9, kUp);
    EXPECT_LT((expected.cMo.inverse().t - x.head<3>()).norm(), 1e-9);
    EXPECT_LT((expected.covariance.topLeftCorner<3, 3>() - P.topLeftCorner<3, 3>()).norm(), 1e-9);

    truth += n * Vector3d(0.1, 0.05, 0.01);
    const Eigen::Matrix<double, 6, 3> gain = P.leftCols<3>() * (P.topLeftCorner<3, 3>() + measured).inverse();
    x += gain * (truth - x.head<3>());
    P -= gain * P.topRows<3>();
    Matrix6d posterior = expected.covariance;
    posterior.topLeftCorner<3, 3>() = P.topLeftCorner<3, 3>();
    motion.update(at(x.head<3>()), posterior);
    EXPECT_LT((motion.velocity() - x.tail<3>()).norm(), 1e-9);
  }
}
} // namespace
