// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The picture of each trunk in the view that shows it best.

#include <bole/camera.h>
#include <bole/trunk.h>

#include <map>
#include <string>
#include <visp3/core/vpImage.h>

namespace bole
{
/// Keeps, for each trunk, the part of the image that shows it best: where the part that is tracked lies inside the
/// picture, is large, and has sharp borders.
class BestViews
{
public:
  /// Looks at the trunk \p id as \p image shows it; its borders are followed from \p tan_low to \p tan_high (tangents
  /// of elevation).
  void add(int id, const vpImage<unsigned char> &image, const PinholeCamera &camera, const RelativeTrunk &trunk,
           double tan_low, double tan_high);
  void forget(int id) { m_views.erase(id); }
  /// Returns a JPEG with the borders drawn, empty for an id whose two borders were never in one picture.
  std::string jpeg(int id) const;

private:
  struct View
  {
    double score = 0; ///< visible size [px^2], less where it leaves the picture or is blurred
    vpImage<unsigned char> crop;
    Eigen::Matrix<double, 2, 4> ends; ///< of the left and the right border in the crop [px]
  };
  std::map<int, View> m_views;
};
} // namespace bole
