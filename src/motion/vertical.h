// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Which way is up, from the trunks: the common vanishing point of the near-vertical edges.
///
/// Idea: the image line of a vertical edge spans, with the camera centre, a plane that contains the
/// vertical. So every edge pixel whose gradient is nearly horizontal gives a normal n = the edge
/// line's plane, and up is the direction u with n . u = 0 for as many as possible: a robust
/// least-squares fit on the sphere, started at several rolls and at the expected direction.
///
/// A lone trunk, or trunks all near one bearing, leave the tilt towards and away from the camera
/// open: the covariance says so.
///
/// Laws (each a test): edges that run through the image of the zenith give the zenith; an image
/// without edges gives the expected direction and the status too_few_edges.
///
/// Cost: about 0.4 ms at 320x240.

#include "geometry/direction.h"
#include <bole/camera.h>

#include <optional>
#include <visp3/core/vpImage.h>

namespace bole
{
struct VerticalOptions
{
  double max_tilt_deg = 30;   ///< of an edge from the expected vertical in the image, 1 .. 60
  double min_gradient = 0.03; ///< per pixel, grey 0 .. 1, > 0
  int cell_px = 12;           ///< side of the patches that vote, 4 .. 64
  double min_coherence = 0.6; ///< of the gradients of a patch, 0 .. 1: 1 is one straight edge
  double sigma_deg = 1.5;     ///< of the direction of a patch's edge (trunks lean, bark is rough), > 0
  int min_edges = 12;         ///< patches, >= 3
  double inflation = 4;       ///< of the covariance, >= 1: patches of one trunk share its lean
};

enum class VerticalStatus
{
  ok,
  too_few_edges
};

struct VerticalEstimate
{
  VerticalStatus status = VerticalStatus::too_few_edges;
  Eigen::Vector3d up = -Eigen::Vector3d::UnitY();           ///< unit vector in the camera frame
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity(); ///< in directionBasis(up) [rad^2]
  int edges = 0;                                            ///< patches that agree
};

/// \param expected_up where up was last, or nullopt: the image is then taken to be upright within
/// max_tilt_deg and the pitch near zero (prior of 20 degrees).
VerticalEstimate gravityFromVerticals(const vpImage<unsigned char> &image, const PinholeCamera &camera,
                                      const std::optional<Eigen::Vector3d> &expected_up = std::nullopt,
                                      const VerticalOptions &options = {});

/// Up in the frame w of a path, from many frames: directions \p up seen with \p covariance in the
/// camera at \p wRc are averaged (robustly) as the flight goes on.
class VerticalFilter
{
public:
  void add(const Eigen::Matrix3d &wRc, const VerticalEstimate &estimate);
  bool known() const { return m_n >= 3; }
  /// Unit vector in w; valid once known().
  Eigen::Vector3d up() const { return m_up; }
  /// In directionBasis(up()) [rad^2]. Frames share the lean of their trunks: ten of them count as
  /// one, and 0.7 degrees stay however many there are.
  Eigen::Matrix2d covariance() const;

private:
  Eigen::Vector3d m_up = Eigen::Vector3d::Zero();
  Eigen::Matrix3d m_information = Eigen::Matrix3d::Zero(); ///< in w, rank 2 a frame
  Eigen::Vector3d m_weighted = Eigen::Vector3d::Zero();
  int m_n = 0;
};
} // namespace bole
