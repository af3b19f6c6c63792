// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Cameras. Every stage behind `input` works on rectified images and a plain pinhole.

#include <Eigen/Core>

#include <array>
#include <bole/visp.h>
#include <visp3/core/vpCameraParameters.h>

namespace bole
{
/// Pinhole of a rectified image. Camera frame: x right, y down, z forward. Pixel centres have whole coordinates.
///
/// Laws (each a test): project(ray(u)) == u; fromVisp(toVisp(camera)) == camera.
struct PinholeCamera
{
  double fx = 200;   ///< focal lengths [px]
  double fy = 200;   ///< focal lengths [px]
  double cx = 159.5; ///< principal point
  double cy = 119.5; ///< the centre of the first pixel is (0, 0) [px]
  int width = 320;   ///< of the image [px]
  int height = 240;  ///< of the image [px]

  /// Pixel of a point or direction in front of the camera (z > 0).
  Eigen::Vector2d project(const Eigen::Vector3d &p) const { return {fx * p.x() / p.z() + cx, fy * p.y() / p.z() + cy}; }
  /// Direction (x, y, 1) of a pixel.
  Eigen::Vector3d ray(const Eigen::Vector2d &u_px) const { return {(u_px.x() - cx) / fx, (u_px.y() - cy) / fy, 1}; }
  /// Whether \p u_px lies in the image, at least \p margin_px from its sides.
  bool contains(const Eigen::Vector2d &u_px, double margin_px = 0) const
  {
    return u_px.x() >= margin_px && u_px.y() >= margin_px && u_px.x() <= width - 1 - margin_px &&
           u_px.y() <= height - 1 - margin_px;
  }
  /// The same view in an image \p factor times as large.
  PinholeCamera scaled(double factor) const;
  /// The same as ViSP writes it (the size of the image is lost).
  vpCameraParameters toVisp() const { return vpCameraParameters(fx, fy, cx, cy); }
  /// \param cam without distortion \param width, height of the image [px]
  static PinholeCamera fromVisp(const vpCameraParameters &cam, int width, int height);
};

/// How the lens bends what the pinhole would show.
enum class Distortion
{
  none,
  radial_tangential, ///< k1, k2, p1, p2 (OpenCV, EuRoC)
  equidistant,       ///< k1 .. k4 (OpenCV fisheye, EuRoC)
  fov                ///< s [rad]: r_d = atan(2 r tan(s/2)) / s (Devernay and Faugeras; PTAM, AR.Drone 1)
};
/// As camera files write it.
const char *toString(Distortion distortion);

/// A calibrated camera with its lens. `input` rectifies its images once a frame.
struct CameraModel
{
  PinholeCamera pinhole;                            ///< of the image without distortion
  Distortion distortion = Distortion::none;         ///< how the lens bends it
  std::array<double, 4> coefficients{{0, 0, 0, 0}}; ///< of the distortion, in the order of its kind

  /// Pixel of the distorted image where the pinhole would show the normalised point (x, y).
  Eigen::Vector2d distort(const Eigen::Vector2d &xy) const;
};
} // namespace bole
