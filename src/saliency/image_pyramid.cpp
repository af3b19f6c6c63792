// SPDX-License-Identifier: GPL-2.0-or-later
#include "saliency/saliency.h"

#include "saliency/saliency_loops.h"

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

template <class Pixel> vpImage<float> halved(const vpImage<Pixel> &image)
{
  vpImage<float> result;
  result.resize(image.getHeight() / 2, image.getWidth() / 2);
  for (unsigned i = 0; i < result.getHeight(); ++i)
    halvedRow(image[2 * i], image[2 * i + 1], static_cast<int>(result.getWidth()), result[i]);
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
    gradientsOfRow(above, row, below, static_cast<int>(width), i > 0 && i + 1 < height ? 0.5f : 0.f,
                   level.gradient_x[i], level.gradient_y[i]);
  }
}
} // namespace

ImagePyramid::ImagePyramid(const vpImage<unsigned char> &image, const PinholeCamera &camera, int levels,
                           int finest_level)
{
  m_levels.reserve(static_cast<std::size_t>(levels));
  m_levels.push_back({camera, {}, {}, {}});
  unsigned height = image.getHeight(), width = image.getWidth();
  while (this->levels() < levels && height >= 2 * kMinSize && width >= 2 * kMinSize) {
    const PyramidLevel &last = m_levels.back();
    PyramidLevel next{last.camera.scaled(0.5), this->levels() == 1 ? halved(image) : halved(last.image), {}, {}};
    height /= 2;
    width /= 2;
    next.camera.width = static_cast<int>(next.image.getWidth());
    next.camera.height = static_cast<int>(next.image.getHeight());
    m_levels.push_back(std::move(next));
  }
  if (finest_level == 0 || this->levels() == 1)
    m_levels[0].image = toFloat(image);
  for (int level = std::min(finest_level, this->levels() - 1); level < this->levels(); ++level)
    addGradients(m_levels[static_cast<std::size_t>(level)]);
}
} // namespace bole
