// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Rotation of the camera and labels of the pixels from two images, together (Section 5, Eq. 10 to 17).
///
/// The E-step (Eq. 10 and 11) asks each pixel of I(t) which explains it better, the rotation alone (background) or a
/// wide distribution of flows (foreground); the velocity of the pixel is integrated out in closed form. The M-step
/// (Eq. 16 and 17) is one Gauss-Newton step on the rotation given the labels, with the gyro as Gaussian prior.
/// It runs from a coarse level of an image pyramid to a fine one.
///
/// Laws (each a test): labels are finite and within [0, 1] on any image; a blank image leaves the prior as it is;
/// a rendered rotation is found.
///
/// Deviations from the paper:
/// - Eq. 10 in the log domain with a logistic; both likelihoods in linear form are 0/0 in double precision.
/// - Eq. 12 warps I(t-1) and Eq. 15 warps I(t). Here pixel u of I(t-1) moves to u + v in I(t), and the labels belong
///   to the pixels of I(t), where the detector wants them: pixel u is compared with I(t-1) at u - v.
/// - Eq. 13: mean of the foreground's flow V w rather than 0, and the exact warp of the rotation rather than V w.
/// - Eq. 16: minimises the negative of what is printed.

#include "saliency/image_pyramid.h"
#include "saliency/saliency_options.h"

#include <Eigen/Core>
#include <optional>

namespace bole
{
/// Rotation of the camera between two frames, as a gyro knows it.
struct RotationPrior
{
  Eigen::Matrix3d pRc = Eigen::Matrix3d::Identity(); ///< current camera in the previous one: Exp(omega)
  /// Of the right perturbation pRc * Exp(phi) [rad^2].
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity() * 1e-6;
};

struct RotationEm
{
  Eigen::Matrix3d pRc = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity(); ///< right perturbation [rad^2]
  int iterations = 0;
  double texture = 0;     ///< share of the pixels of the finest level whose gradient tells them apart
  bool converged = false; ///< the last step was under 1e-4 rad
  /// log p(background) - log p(foreground) without the prior of the labels, at the finest level worked on.
  /// Empty where nobody asked for labels.
  vpImage<float> log_ratio;
};

/// \param prior the gyro's rotation; without it the search starts from \p start with wide labels.
/// \param with_labels one more pass makes the log ratios.
RotationEm estimateRotation(const ImagePyramid &previous, const ImagePyramid &current,
                            const std::optional<RotationPrior> &prior, const Eigen::Matrix3d &start,
                            const SaliencyOptions &options, bool with_labels = true);
} // namespace bole
