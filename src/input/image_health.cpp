// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/image_health.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fmt/format.h>
#include <visp3/core/vpException.h>

namespace bole
{
const char *toString(ImageFault fault)
{
  switch (fault) {
  case ImageFault::none:
    return "none";
  case ImageFault::wrong_size:
    return "wrong size";
  case ImageFault::black:
    return "black";
  case ImageFault::noise:
    return "noise";
  case ImageFault::frozen:
    return "frozen";
  case ImageFault::smeared:
    return "smeared";
  }
  return "?";
}

void ImageHealth::Options::validate() const
{
  const auto check = [](const char *name, double value, double low, double high) {
    if (!(value >= low && value <= high))
      throw vpException(vpException::badValue, fmt::format("{} = {}, must be {} .. {}", name, value, low, high));
  };
  check("min_deviation", min_deviation, 0, 50);
  check("max_roughness", max_roughness, 0.3, 1);
  check("max_repeated", max_repeated, 0, 1);
  check("same_pixels", same_pixels, 0.5, 1);
}

ImageHealth::Numbers ImageHealth::measure(const vpImage<unsigned char> &I)
{
  const int w = int(I.getWidth()), h = int(I.getHeight());
  Numbers numbers;
  if (w < 8 || h < 8)
    return numbers;
  long n = 0, sum = 0, squares = 0, rough = 0;
  int repeated_rows = 0;
  for (int v = 1; v < h; ++v) {
    const unsigned char *row = I[unsigned(v)], *above = I[unsigned(v - 1)];
    int difference = 0;
    for (int u = 1; u < w; u += 4) {
      const int g = row[u];
      sum += g, squares += g * g;
      rough += std::abs(g - row[u - 1]);
      difference += std::abs(g - above[u]);
      ++n;
    }
    repeated_rows += difference * 8 < w / 4 ? 1 : 0; // less than an eighth of a grey level a pixel
  }
  int repeated_columns = 0;
  for (int u = 4; u < w; ++u) {
    int difference = 0;
    for (int v = 0; v < h; v += 8)
      difference += std::abs(I[unsigned(v)][u] - I[unsigned(v)][u - 1]);
    repeated_columns += difference * 8 < h / 8 ? 1 : 0;
  }
  const double mean = double(sum) / double(n);
  numbers.deviation = std::sqrt(std::max(0.0, double(squares) / double(n) - mean * mean));
  numbers.roughness = numbers.deviation > 0 ? double(rough) / double(n) / numbers.deviation : 0;
  numbers.repeated = std::max(double(repeated_rows) / h, double(repeated_columns) / w);
  return numbers;
}

void ImageHealth::start(const vpImage<unsigned char> &I)
{
  m_last = I;
  m_may_repeat = true;
  m_good_repeated = measure(I).repeated;
}

ImageFault ImageHealth::check(const vpImage<unsigned char> &I)
{
  if (I.getWidth() != m_last.getWidth() || I.getHeight() != m_last.getHeight())
    return ImageFault::wrong_size;
  bool same = false;
  if (m_options.detect_frozen && !m_may_repeat) {
    long equal = 0;
    for (unsigned i = 0; i < I.getSize(); ++i)
      equal += I.bitmap[i] == m_last.bitmap[i] ? 1 : 0;
    same = double(equal) >= m_options.same_pixels * double(I.getSize());
  }
  m_may_repeat = false;
  const Numbers numbers = measure(I);
  std::copy(I.bitmap, I.bitmap + I.getSize(), m_last.bitmap);
  if (numbers.deviation < m_options.min_deviation)
    return ImageFault::black;
  if (numbers.roughness > m_options.max_roughness)
    return ImageFault::noise;
  if (same)
    return ImageFault::frozen;
  if (numbers.repeated > m_good_repeated + m_options.max_repeated)
    return ImageFault::smeared;
  m_good_repeated = numbers.repeated;
  return ImageFault::none;
}
} // namespace bole
