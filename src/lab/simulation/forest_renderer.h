// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Pictures of a forest, by ray casting (Intel Embree), fast enough for a closed loop.
///
/// Idea: the forest stands still and only the camera moves, so everything that does not depend on the camera is
/// computed once: sun and sky light on the ground, on each trunk and on each leaf go into light maps. A frame then
/// costs its primary rays, in coherent packets of 16, and table look-ups. The samples of a pixel are spread over its
/// area and over the time of exposure: antialiasing and motion blur are one.

#include "simulation/forest.h"
#include <bole/camera.h>

#include <memory>
#include <visp3/core/vpImage.h>

namespace bole
{
struct RendererOptions
{
  CameraModel camera;             ///< the lens bends the picture; images come out as the sensor sees them
  int samples_per_pixel = 4;      ///< 1 to 64; 3 for a closed loop at 30 frames/s, 8 or more for recorded flights
  double exposure_target = 112;   ///< grey level the automatic exposure aims at, 20 to 230
  double exposure_lag_frames = 6; ///< time constant of the automatic exposure, 0 (fixed gain) to 100
  double gain_step = 0.04;        ///< the gain moves in steps of this ratio, as cameras do, 0 to 0.5
  double read_noise = 1.2;        ///< standard deviation in grey levels, 0 to 50
  double shot_noise = 0.16;       ///< standard deviation per square root of a grey level, 0 to 5
  std::uint64_t noise_seed = 1;

  /// Throws vpException "name = value, must be ...".
  void validate() const;
};

/// One picture. Depth and trunk ids are those of the ray through each pixel's centre in the middle of the exposure.
struct RenderedFrame
{
  vpImage<unsigned char> image;
  vpImage<std::uint16_t> depth;    ///< along the optical axis [mm], 65535 = sky or beyond 65 m; empty unless wanted
  vpImage<std::uint16_t> trunk_id; ///< id of the trunk (far ones from 10000), 65535 = none; empty unless wanted
  double gain = 1;                 ///< of this frame's exposure
};

/// Laws (each a test): same forest, options and poses, same bytes; the borders of a trunk without lean, bow, taper and
/// flare are those of relativeTrunk() to 0.1 px; depth agrees with the ray-cylinder distance.
///
/// Cost: about 9 ms a sample a pixel and frame of 320x240 on one core (3 samples: 27 ms);
/// construction a second or two. Not thread-safe: one renderer a thread.
class ForestRenderer
{
public:
  ForestRenderer(const Forest &forest, const RendererOptions &options);
  ~ForestRenderer();

  /// The picture taken while the camera moves from \p wMc_open to \p wMc_close.
  /// \param with_truth fill depth and trunk_id too.
  void render(const Pose &wMc_open, const Pose &wMc_close, RenderedFrame &frame, bool with_truth = false);
  /// The picture of a camera that stands still.
  void render(const Pose &wMc, RenderedFrame &frame, bool with_truth = false) { render(wMc, wMc, frame, with_truth); }

  const CameraModel &camera() const;

private:
  struct State;
  std::unique_ptr<State> m_state;
};
} // namespace bole
