// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// From light on the sensor to grey levels: automatic exposure, noise, quantisation.

#include "simulation/forest_renderer.h"

#include <vector>

namespace bole
{
class SensorImage
{
public:
  explicit SensorImage(const RendererOptions &options);
  /// Takes the next picture; returns its gain (grey levels per unit of radiance).
  double expose(const std::vector<float> &radiance, vpImage<unsigned char> &image);

private:
  double meanGrey(const std::vector<float> &radiance, double gain) const;
  double stepped(double gain) const;

  RendererOptions m_options;
  std::vector<float> m_normals; ///< tabulated normal numbers
  std::uint64_t m_frame = 0;
  double m_gain = 0; ///< 0 before the first picture
};
} // namespace bole
