// SPDX-License-Identifier: GPL-2.0-or-later
#include "saliency/image_pyramid.h"

#include <algorithm>

namespace bole
{
namespace
{
constexpr unsigned kMinSize = 16;

vpImage<float> toFloat(const vpImage<unsigned char> &image)
{
  vpImage<float> result; // resize() leaves it as it is, the constructor would fill it
  result.resize(image.getHeight(), image.getWidth());
  for (unsigned i = 0; i < image.getSize(); ++i)
    result.bitmap[i] = image.bitmap[i] * (1.f / 255.f);
  return result;
}

vpImage<float> halved(const vpImage<float> &image)
{
  vpImage<float> result;
  result.resize(image.getHeight() / 2, image.getWidth() / 2);
  for (unsigned i = 0; i < result.getHeight(); ++i) {
    const float *upper = image[2 * i], *lower = image[2 * i + 1];
    float *out = result[i];
    for (unsigned j = 0; j < result.getWidth(); ++j)
      out[j] = 0.25f * (upper[2 * j] + upper[2 * j + 1] + lower[2 * j] + lower[2 * j + 1]);
  }
  return result;
}

void addGradients(PyramidLevel &level)
{
  const vpImage<float> &image = level.image;
  const unsigned height = image.getHeight(), width = image.getWidth();
  level.gradient_x.resize(height, width);
  level.gradient_y.resize(height, width);
  for (unsigned i = 0; i < height; ++i) {
    const float *above = image[i > 0 ? i - 1 : i], *row = image[i], *below = image[i + 1 < height ? i + 1 : i];
    float *gx = level.gradient_x[i], *gy = level.gradient_y[i];
    for (unsigned j = 1; j + 1 < width; ++j)
      gx[j] = 0.5f * (row[j + 1] - row[j - 1]);
    gx[0] = gx[width - 1] = 0;
    const float scale = i > 0 && i + 1 < height ? 0.5f : 0.f;
    for (unsigned j = 0; j < width; ++j)
      gy[j] = scale * (below[j] - above[j]);
  }
}
} // namespace

ImagePyramid::ImagePyramid(const vpImage<unsigned char> &image, const PinholeCamera &camera, int levels,
                           int finest_level)
{
  m_levels.reserve(static_cast<std::size_t>(levels));
  m_levels.push_back({camera, toFloat(image), {}, {}});
  while (this->levels() < levels) {
    const PyramidLevel &last = m_levels.back();
    if (last.image.getHeight() < 2 * kMinSize || last.image.getWidth() < 2 * kMinSize)
      break;
    PyramidLevel next{last.camera.scaled(0.5), halved(last.image), {}, {}};
    next.camera.width = static_cast<int>(next.image.getWidth());
    next.camera.height = static_cast<int>(next.image.getHeight());
    m_levels.push_back(std::move(next));
  }
  for (int level = std::min(finest_level, this->levels() - 1); level < this->levels(); ++level)
    addGradients(m_levels[static_cast<std::size_t>(level)]);
}
} // namespace bole
