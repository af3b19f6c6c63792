// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Options of the saliency stage.

namespace bole
{
struct SaliencyOptions
{
  // --- the model of Eq. 12 and 13
  double sigma_background_px =
      2; ///< flow of the background about V w [px, full resolution]; (0, 20]. What counts as parallax
  double sigma_foreground_px = 10; ///< the same for the foreground [px]; (sigma_background_px, 200]

  // --- EM of Eq. 16 and 17
  int levels = 4;       ///< levels of the pyramid, each half the size of the one before; [1, 8]
  int finest_level = 1; ///< 0 works at full resolution, 1 at half; [0, levels - 1]. Half is 4 times as fast

  // --- labels that ask about inverse depth, where the translation is given
  double near_range = 10.5; ///< nearer than this is foreground [m]; (0.1, 1000]. What matters for planning
  double min_range = 2;     ///< nearest range of the sweep [m]; (0.05, near_range)
  int window_width_px = 3;  ///< residuals are averaged over this window [px at the working level]; odd, [1, 31]
  int window_height_px = 9; ///< trunks are upright: taller than wide; odd, [1, 31]
  int max_frames_apart = 5; ///< oldest frame that is tried; [1, 20]
};
} // namespace bole
