// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Trunks followed by their bark from image to image.
///
/// Idea: where a trunk fills a good part of the image, its borders are read again and again, and one that is taken for
/// a line of light and shade, or of what passes behind, draws the trunk along with it. The bark tells how the trunk
/// moved since the last image to a fraction of a pixel, whatever its borders look like, but not where it is; the
/// borders tell where it is, to a pixel, but may be misread. So the bearing of a trunk is filtered: carried on by its
/// bark, corrected by its borders; that is where the borders are looked for in the next image.
///
/// Laws (each a test): where the camera did not go as it was told, the prediction is mended; a border that slips by
/// some pixels an image is not followed; what is not read for long is looked for as if it had no bark.

#include "pipeline/trunk_measurement.h"
#include "tracking/texture_shift.h"

#include <unordered_map>

namespace bole
{
class TextureTracker
{
public:
  /// Moves the prediction of each confirmed trunk to where its texture is in \p image, which was taken from pose number
  /// \p pose. \p before: the camera one pose earlier.
  void predict(const vpImage<unsigned char> &image, std::size_t pose, const Pose &before, const Viewpoint &view,
               const TrunkMap &map, std::vector<PredictedTrunk> &predicted);
  /// Corrects the filtered bearings by the borders measured in this image.
  void correct(const std::vector<TrackedTrunk> &tracked, const PinholeCamera &camera);

private:
  struct FilteredBearing
  {
    RelativeTrunk seen;
    double variance = 0; ///< of its bearing [rad^2]
  };
  std::unordered_map<int, FilteredBearing> m_tracked; ///< by id of the hypothesis
  vpImage<unsigned char> m_image;
  std::size_t m_pose = 0; ///< of it; 0: none yet
};
} // namespace bole
