// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How far the camera has turned between two images, without a gyro and without a model.
///
/// Idea: thumbnails of both images, smoothed by their size, are compared at every shift of a window (the
/// widest start there is: a turn of 40 px is 5 px in a thumbnail); the best shift starts a robust
/// Gauss-Newton alignment over the three rotations at twice that resolution. Near objects that move by
/// parallax are outliers of it. The border scan, whose basin is narrow, then starts within a pixel or two.
///
/// Cost: about 0.3 ms at any size, since the thumbnails are of one size. Works on copies; one aligner a thread.

#include <bole/camera.h>

#include <Eigen/Core>

#include <vector>
#include <visp3/core/vpImage.h>

namespace bole
{
/// A small, mean-free float image of the width and height of a pinhole scaled by its factor.
struct Thumbnail
{
  int width = 0, height = 0;
  std::vector<float> grey;

  float at(int u, int v) const { return grey[std::size_t(v * width + u)]; }
  bool empty() const { return grey.empty(); }
};

struct RotationAlignment
{
  Eigen::Matrix3d c2Rc1 = Eigen::Matrix3d::Identity(); ///< takes directions in the first camera to the second
  double correlation = 0; ///< normalised cross-correlation of the thumbnails where both exist, -1 .. 1
  bool ok = false;        ///< the correlation reached Options::min_correlation
};

class RotationAligner
{
public:
  struct Options
  {
    double max_turn_px = 44;      ///< widest yaw shift searched, pixels of the full image (16 .. 120)
    double max_tilt_px = 24;      ///< widest pitch shift searched (0 .. 60)
    double min_correlation = 0.5; ///< below it the images do not show the same scene (0 .. 1)
    int iterations = 8;           ///< of Gauss-Newton (1 .. 30)
  };
  RotationAligner() : RotationAligner(Options()) {}
  explicit RotationAligner(const Options &options);

  /// Two thumbnails of one image, coarse (1/8 at 320 pixels, 1/16 at 640) and fine (twice as many).
  struct Reference
  {
    Thumbnail coarse, fine;
    bool empty() const { return fine.empty(); }
  };
  static Reference reduce(const vpImage<unsigned char> &image);

  /// Rotation of the camera from \p first to \p second, both of \p camera.
  RotationAlignment align(const Reference &first, const Reference &second, const PinholeCamera &camera) const;
  /// Normalised cross-correlation of \p second with \p first turned by \p c2Rc1, without any search.
  static double correlation(const Reference &first, const Reference &second, const PinholeCamera &camera,
                            const Eigen::Matrix3d &c2Rc1);

private:
  Options m_options;
};
} // namespace bole
