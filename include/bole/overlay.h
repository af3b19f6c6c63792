// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Pictures of what the pipeline sees: trunks drawn into the image, and the saliency field.

#include <bole/camera.h>
#include <bole/trunk_record.h>

#include <bole/visp.h>
#include <string>
#include <vector>
#include <visp3/core/vpImage.h>
#include <visp3/core/vpRGBa.h>

namespace bole
{
/// What goes into one picture.
struct Overlay
{
  std::vector<TrunkInView> trunks; ///< what is drawn; dashed where it was not measured in this frame
  vpImage<float> foreground;       ///< probability of being near, 0 .. 1, any size, for the inset; may be empty
  std::string text;                ///< one line below the image
  bool is_warning = false;         ///< the line is about a frame that is not ok
};

/// Draws \p overlay on \p image, enlarged by a whole number to about 640 columns or more, with a line of text below.
/// Borders have a colour for each id (candidates are thin), labels say id and distance and do not cover one another,
/// the saliency is an inset in the upper right corner, a legend stands in the bar of text. The size depends on that of
/// the camera's image alone; an empty image is drawn grey.
vpImage<vpRGBa> drawOverlay(const vpImage<unsigned char> &image, const PinholeCamera &camera, const Overlay &overlay);

/// The image and, beside it, the field \p foreground (0 .. 1, any size) in colours (the paper's Fig. 8).
vpImage<vpRGBa> drawSaliency(const vpImage<unsigned char> &image, const PinholeCamera &camera,
                             const vpImage<float> &foreground, const std::string &text);

/// A colour that stays with an id: one of the palette of Okabe and Ito, those that stand out on a wood made brighter.
vpRGBa colourOf(int id);
} // namespace bole
