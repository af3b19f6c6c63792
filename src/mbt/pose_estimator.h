// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The estimation behind vpMbTrunkTracker: from an image and an expected pose to a pose, its covariance and a verdict.
///
/// Steps of a frame: predict() (motion prior, or constant velocity), scan all visible borders under the predicted
/// covariance, vote() on the pose that all of them support, follow the maxima next to it, servo the pose, scan again
/// narrowly, servo again, judge.
///
/// Poses are cMo; covariances those of the camera's twist in m and rad: cMo_true = exp(-xi) cMo.
#include "mbt/model_trunk.h"
#include <bole/pose.h>

#include <vector>

namespace bole
{
// All borders of all trunks vote on how far the camera is from where it was expected.
//
// Idea: one border's strongest edge is the right one only in about half of the views of a textured forest, so no
// border may decide alone. But all borders move with the same six numbers, and their profiles tell the energy at every
// offset. So the joint energy of a pose is one look-up a border, and thousands of poses under the predicted covariance
// are tried on a grid over the three directions in which the prediction leaves the borders most uncertain.

struct BallotBorder
{
  /// Offset of the border in the image [px] per twist of the camera.
  Eigen::Matrix<double, 1, 6> offset_by_twist = Eigen::Matrix<double, 1, 6>::Zero();
  std::vector<float> response; ///< 0 .. 1 at offsets -half .. half, step 1 px
};

struct Vote
{
  Vector6d twist = Vector6d::Zero(); ///< from the prediction to the best pose
  double score = 0;                  ///< sum of the responses there over the number of borders, 0 .. 1
};

/// The twist with the greatest log-likelihood: that of the responses less half its squared deviation under \p
/// covariance.
Vote vote(const std::vector<BallotBorder> &borders, const Matrix6d &covariance);

/// The pose after the camera has moved by the twist \p xi, and the twist between two poses. They are each other's
/// inverse.
Pose movedBy(const Pose &cMo, const Vector6d &xi);
Vector6d twistBetween(const Pose &from, const Pose &to);

struct ExpectedPose
{
  Pose cMo;
  Matrix6d covariance = Matrix6d::Identity();
};

class PoseEstimator
{
public:
  using Options = vpMbTrunkTracker::Options;
  using Status = vpMbTrunkTracker::Status;

  Options options;
  std::vector<ModelTrunk> trunks;
  double far_m = 0; ///< trunks beyond are not used; 0: no limit
  Matrix6d free_in_object =
      Matrix6d::Identity(); ///< projection on the degrees of freedom to be estimated, object frame
  bool is_all_free = true;
  double gain = 1;                   ///< of a step of the servoing
  int iterations = 8;                ///< at most
  std::optional<ExpectedPose> prior; ///< of the next frame; used once

  /// Takes \p cMo as the pose of image \p I, known to a centimetre and half a degree, and learns the contrasts there.
  void start(const vpImage<unsigned char> &I, const PinholeCamera &camera, const Pose &cMo);
  /// Moves the camera without learning; the velocity is not known afterwards.
  void setPose(const Pose &cMo);
  /// Estimates the pose in \p I. Anything but `tracked`, `partly_on_prior` and `uncertain` leaves the prediction.
  Status track(const vpImage<unsigned char> &I, const PinholeCamera &camera);
  /// A frame without an image that can be believed: the pose is the prediction.
  void skip();
  void forget();

  const Pose &pose() const { return m_pose; }
  const Matrix6d &covariance() const { return m_covariance; }
  /// Directions of the twist (6 x k) that the image does not know: [m] and [rad * lever_m].
  const Eigen::MatrixXd &unobserved() const { return m_unobserved; }
  const std::string &message() const { return m_message; }
  /// Calls \p f (piece, border) for each found place of the last frame.
  template <class F> void forEachPiece(F f) const
  {
    for (const std::size_t k : m_in_view)
      for (const ModelBorder &border : trunks[k].borders())
        for (const FoundPiece &piece : border.pieces)
          if (border.chosen >= 0 && piece.used)
            f(piece, border);
  }

private:
  struct Normal
  {
    Matrix6d H = Matrix6d::Zero();
    Vector6d b = Vector6d::Zero();
  };
  ExpectedPose predict() const;
  Vector6d freePart(const Vector6d &xi) const;
  void predictTrunks(const PinholeCamera &camera);
  void scanTrunks(const vpImage<unsigned char> &I, const Matrix6d &covariance, double max_half_px);
  Vote agree(const Matrix6d &covariance) const;
  void choosePeaks(const Vector6d &twist, double reach_px, const PinholeCamera &camera);
  Status search(const vpImage<unsigned char> &I, const PinholeCamera &camera, const ExpectedPose &expected);
  double surprise(const ExpectedPose &expected, double agreement) const;
  void keep(const ExpectedPose &expected);
  Status judge();
  // pose_servo.cpp
  void servo(const ExpectedPose &expected, double focal_px);
  void linearise();
  void weigh(double focal_px);
  Normal normalEquations(double focal_px) const;
  double support() const;

  std::vector<std::size_t> m_in_view; ///< indices of the trunks that the current scan uses, nearest first
  Pose m_pose;
  Matrix6d m_covariance = Matrix6d::Zero(), m_information = Matrix6d::Zero(); ///< the latter: of the image alone
  Eigen::MatrixXd m_unobserved = Eigen::MatrixXd(6, 0);
  std::optional<Vector6d> m_velocity; ///< twist a frame
  int m_frames_since_good = 0;
  double m_agreement = 1; ///< of the borders, over the last frames
  bool m_is_doubtful = false;
  std::string m_message;
};
} // namespace bole
