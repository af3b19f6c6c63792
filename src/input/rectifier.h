// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// From the images of a real lens to those of a pinhole of a handy size.

#include <bole/camera.h>

#include <memory>
#include <visp3/core/vpImage.h>

namespace bole
{
/// Undistorts and shrinks images by one precomputed map.
///
/// Idea: every stage behind `input` works with straight lines, so the lens is undone once a frame. The image is first
/// shrunk by averaging areas to at most \p max_width_px (trunks need no more than 320 to 640 columns, and the cost of
/// every stage grows with the pixels), then the map is applied to the small image. The focal length of the output is
/// the shortest one, between 0.6 and 2 times that of the lens, at which every output pixel sees the input image, so no
/// made-up border enters the gradients.
///
/// Without distortion and shrinking the image is handed over as it is. Cost at 320x240: a fraction of a millisecond.
/// Not for two threads at once (it keeps a scratch image).
/// Law (a test): an image drawn through the lens comes out as one drawn through camera().
class Rectifier
{
public:
  /// \param max_width_px images wider than this are shrunk to it; 0 to keep every size.
  explicit Rectifier(const CameraModel &model, int max_width_px = 0);
  ~Rectifier();
  Rectifier(Rectifier &&) noexcept;
  Rectifier &operator=(Rectifier &&) noexcept;

  /// Size of the images apply() takes [px].
  int inputWidth() const;
  int inputHeight() const;
  /// Pinhole of the images apply() gives.
  const PinholeCamera &camera() const;
  bool isIdentity() const;

  /// \p image is exchanged for its rectified form. Throws vpException when its size is not the input's.
  void apply(vpImage<unsigned char> &image) const;

private:
  struct Map;
  std::unique_ptr<Map> m_map;
};
} // namespace bole
