// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/renderer_parts.h"

#include "simulation/random.h"

#include <algorithm>
#include <cmath>

namespace bole
{
SensorImage::SensorImage(const RendererOptions &options) : m_options(options)
{
  Random random(options.noise_seed, 201);
  m_normals.resize(1u << 16);
  for (float &value : m_normals)
    value = static_cast<float>(random.normal());
}

double SensorImage::meanGrey(const std::vector<float> &radiance, double gain) const
{
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t k = 0; k < radiance.size(); k += 7, ++count)
    sum += std::min(255.f, static_cast<float>(gain) * radiance[k]);
  return std::max(1.0, sum / static_cast<double>(count));
}

double SensorImage::stepped(double gain) const
{
  if (m_options.gain_step <= 0)
    return gain;
  const double step = std::log1p(m_options.gain_step);
  return std::exp(step * std::round(std::log(gain) / step));
}

double SensorImage::expose(const std::vector<float> &radiance, vpImage<unsigned char> &image)
{
  if (m_gain <= 0) { // the camera has been on for a while
    m_gain = 250;
    for (int k = 0; k < 20; ++k)
      m_gain *= m_options.exposure_target / meanGrey(radiance, m_gain);
  }
  const double gain = stepped(m_gain);
  const unsigned width = m_options.camera.pinhole.width, height = m_options.camera.pinhole.height;
  image.resize(height, width);
  Random random(m_options.noise_seed, 1000 + m_frame++);
  const float read2 = static_cast<float>(m_options.read_noise * m_options.read_noise);
  const float shot2 = static_cast<float>(m_options.shot_noise * m_options.shot_noise);
  for (unsigned row = 0; row < height; ++row) {
    const std::size_t offset = random.next();
    for (unsigned column = 0; column < width; ++column) {
      const float grey = static_cast<float>(gain) * radiance[static_cast<std::size_t>(row) * width + column];
      const float noise = std::sqrt(read2 + shot2 * grey) * m_normals[(offset + 17 * column) & 0xffff];
      image[row][column] = static_cast<unsigned char>(std::clamp(grey + noise + 0.5f, 0.f, 255.f));
    }
  }
  if (m_options.exposure_lag_frames > 0)
    m_gain *= std::pow(m_options.exposure_target / meanGrey(radiance, gain), 1 / (1 + m_options.exposure_lag_frames));
  return gain;
}
} // namespace bole
