// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Bundle adjustment of a small window: a few camera poses, and points known by the ray of the
/// frame that saw them first and one inverse depth each. Robust Gauss-Newton (Levenberg-Marquardt);
/// the inverse depths are eliminated one by one (Schur), so a step costs a dense solve of 6
/// unknowns a free frame.

#include <bole/pose.h>

#include <optional>
#include <vector>

namespace bole::motion
{
struct BundleFrame
{
  Pose wMc;
  bool fixed = false;
  /// Rotation from this frame to the one before it in the window by the gyro, with its information.
  std::optional<Eigen::Matrix3d> previousRthis;
  Eigen::Matrix3d rotation_information = Eigen::Matrix3d::Zero();
};

struct BundleObservation
{
  std::size_t frame = 0;
  Eigen::Vector2d xy; ///< normalised
  double weight = 1;  ///< robust, after solveBundle()
};

struct BundlePoint
{
  std::size_t anchor = 0;   ///< frame whose ray it is
  Eigen::Vector2d xy;       ///< of the ray (x, y, 1) in the anchor
  double inverse_depth = 0; ///< along z of the anchor [1/unit]
  double prior = 0, prior_information = 0;
  double information = 0;              ///< of the inverse depth, the poses taken as known; after solveBundle()
  std::vector<BundleObservation> seen; ///< in other frames than the anchor
};

struct BundleOptions
{
  int iterations = 5;
  double sigma = 1e-3;                  ///< of an observation, one coordinate [normalised]
  double min_sigma = 2e-4;              ///< floor when sigma is measured anew
  std::optional<double> first_baseline; ///< distance of the frames 0 and 1 that fixes the scale
  double settled = 1e-3;                ///< share of the cost that an iteration must gain for another
  bool with_focal = false;              ///< the focal length by which all was normalised is unknown, too
  double log_focal = 0;                 ///< where it starts
};

struct BundleResult
{
  bool solved = false;
  double sigma = 0;                                ///< of the bulk of the observations
  double inliers = 0;                              ///< share of observations of weight above 1/2
  Matrix6d last_covariance = Matrix6d::Identity(); ///< of the last frame, the other poses taken as known, per sigma
  double log_focal = 0;                            ///< of the focal length over that by which all was normalised
  double focal_sigma = 0;                          ///< of log_focal, of independent observations
};

/// Residual (predicted - seen) of a point in a frame, derivatives by the tangents (rho, phi) of
/// both poses and by the inverse depth (each may be nullptr). \p focal: the camera's focal length over that by which
/// both positions were normalised; J_f: by its logarithm.
Eigen::Vector2d reprojection(const Pose &wMa, const Pose &wMb, const Eigen::Vector2d &xy_a, double inverse_depth,
                             const Eigen::Vector2d &xy_b, Eigen::Matrix<double, 2, 6> *J_a = nullptr,
                             Eigen::Matrix<double, 2, 6> *J_b = nullptr, Eigen::Vector2d *J_q = nullptr,
                             double focal = 1, Eigen::Vector2d *J_f = nullptr);

/// The inverse depth of \p point, by all that see it; at least 0.
void triangulate(BundlePoint &point, const std::vector<BundleFrame> &frames);

BundleResult solveBundle(std::vector<BundleFrame> &frames, std::vector<BundlePoint> &points,
                         const BundleOptions &options);
} // namespace bole::motion
