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
/// A small or leafy picture shows fewer edges than a fit needs; the edges of the frames before it, turned as the camera
/// was, make up for that.
///
/// A lone trunk, or trunks all near one bearing, leave the tilt towards and away from the camera
/// open: the covariance says so.
///
/// Laws (each a test): edges that run through the image of the zenith give the zenith; an image
/// without edges gives the expected direction, which is not known then.
///
/// Cost: about 0.4 ms at 320x240.

#include "geometry/direction.h"
#include <bole/camera.h>

#include <deque>
#include <optional>
#include <vector>
#include <visp3/core/vpImage.h>

namespace bole
{
struct VerticalEstimate
{
  bool known = false;                             ///< by edges enough
  Eigen::Vector3d up = -Eigen::Vector3d::UnitY(); ///< unit vector in the camera frame, with the prior
  /// What the edges alone say, in directionBasis(up): information [1/rad^2] and gradient [1/rad] of their
  /// log-likelihood at up, where the prior balances it.
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
  int edges = 0;    ///< patches that agree
  double share = 0; ///< of them beyond those that would agree by chance, 0 to 1

  bool isSure() const { return known && share > 0.5; }
};

/// A straight edge that may be vertical, in the frame of a camera or of a path.
struct VerticalEdge
{
  Eigen::Vector3d normal; ///< unit, of the plane through the camera centre and the edge
  Eigen::Vector3d ray;    ///< unit, to its middle

  /// Sine of the angle, seen along the ray, between the edge and the direction to \p up. The distance of \p up from
  /// the plane alone would be small for any edge when \p up lies along the ray: in a narrow field of view all would
  /// agree on the optical axis.
  double off(const Eigen::Vector3d &up) const { return normal.dot(up) / across(up); }
  double across(const Eigen::Vector3d &up) const { return std::max(0.05, ray.cross(up).norm()); }
};

/// Up from the edges of an image and, where these are too few, of images shortly before.
class VerticalFinder
{
public:
  /// \p wRc: rotation of the camera of \p image on its path. \p expected_up: where up was last, in the camera;
  /// without it the image is taken to be upright within 30 degrees and the pitch near zero (prior of 20 degrees).
  VerticalEstimate find(const vpImage<unsigned char> &image, const PinholeCamera &camera, const Eigen::Matrix3d &wRc,
                        const std::optional<Eigen::Vector3d> &expected_up);

private:
  std::deque<std::vector<VerticalEdge>> m_earlier; ///< of the last images, in w
};

/// Up in the frame w of a path, from many frames: a Kalman filter of a direction. A narrow view sees its roll and
/// hardly its pitch, so each frame counts in the directions that its edges tell; the rotation of the path drifts, so
/// old frames fade.
///
/// Laws (each a test): a pan tells what one view cannot; a path that drifts is followed.
class VerticalFilter
{
public:
  void add(const Eigen::Matrix3d &wRc, const VerticalEstimate &estimate);
  bool known() const { return m_share > 1.5; } ///< three frames of which half of the edges agree, or more of fewer
  /// Unit vector in w; valid once known().
  Eigen::Vector3d up() const { return m_up; }
  /// In directionBasis(up()) [rad^2]. Frames share the lean of their trunks: ten of them count as
  /// one, and 0.7 degrees stay however many there are.
  Eigen::Matrix2d covariance() const;

private:
  Eigen::Vector3d m_up = Eigen::Vector3d::Zero();
  Eigen::Matrix3d m_information = Eigen::Matrix3d::Zero(); ///< in w, across m_up [1/rad^2]
  int m_n = 0;
  double m_share = 0; ///< sum over the frames
};
} // namespace bole
