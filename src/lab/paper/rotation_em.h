// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Section 5 of the paper, Eq. 10 to 17: the turn of the camera between two images, and which pixels move with it.
///
/// The E-step (Eq. 10 and 11) asks each pixel which explains it better, the turn alone (background) or a wide
/// distribution of flows (foreground); the velocity of the pixel is integrated out in closed form. The M-step (Eq. 16
/// and 17) is one Gauss-Newton step on the turn given the labels. At full resolution, from the turn of the gyro.
///
/// Slips of the print put right: Eq. 10 in the log domain (both likelihoods are 0/0 in double precision); Eq. 12 warps
/// I(t-1) and Eq. 15 I(t): here pixel u of I(t) is compared with I(t-1) at u - v; Eq. 16 minimises the negative of what
/// is printed.
///
/// Laws (each a test): the labels are the integrals over all image velocities; the M-step is where the expected
/// negative log-likelihood is least; V is what a turn does to the image.

#include <bole/camera.h>

#include <Eigen/Core>
#include <visp3/core/vpImage.h>

namespace bole::paper
{
constexpr double kIntensity = 0.02;             ///< sigma_I, noise of a pixel [full scale]
constexpr double kBackground_px = 0.15;         ///< of Sigma_b: flow about V omega
constexpr double kForeground_px = 3;            ///< of Sigma_f: flow about 0
constexpr int kIterations = 8;                  ///< of EM
using FlowMatrix = Eigen::Matrix<double, 2, 3>; ///< V
using Turn = Eigen::Matrix3d;                   ///< pRc: current camera in the previous one, Exp(omega)

/// Eq. 14 [px/rad], with both focal lengths.
FlowMatrix flowMatrix(const PinholeCamera &camera, const Eigen::Vector2d &u_px);

/// An image with its gradient by central differences, 1 = full scale.
struct GreyImage
{
  vpImage<float> grey, by_x, by_y;

  GreyImage() = default;
  explicit GreyImage(const vpImage<unsigned char> &image);
};

/// What EM found.
struct TurnAndLabels
{
  Turn pRc = Turn::Identity();
  vpImage<float> log_ratio; ///< log of p(pixel | background) over p(pixel | foreground), 0 where nothing is known
};

/// \p start: of the iterations.
TurnAndLabels estimateTurn(const GreyImage &previous, const GreyImage &current, const PinholeCamera &camera,
                           const Turn &start, int iterations = kIterations);
} // namespace bole::paper
