// SPDX-License-Identifier: GPL-2.0-or-later
#include "detection/border_continuity.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace bole
{
namespace
{
constexpr int kSamples = 4;  ///< across a strip
constexpr double kNoise = 2; ///< of a camera, a pixel [grey levels]: a smooth surface changes by less, and says nothing
constexpr double kChangesOfNoise = 10 * kSamples * kNoise * kNoise; ///< variance that it gives changesAlong()

/// Changes from row to row, smoothed by a binomial of three, of the sum of kSamples of \p image from \p near to \p far
/// pixels to the right of \p line.
std::vector<double> changesAlong(const vpImage<unsigned char> &image, const BorderLine &line, double near, double far)
{
  std::vector<double> sum(static_cast<std::size_t>(line.rows()), 0.0), changes;
  for (int i = 0; i < line.rows(); ++i) {
    const unsigned char *row = image[static_cast<unsigned>(line.row_begin + i)];
    for (int k = 0; k < kSamples; ++k) {
      const double x = line.xAt(line.row_begin + i) + near + (far - near) * k / (kSamples - 1);
      const int column = static_cast<int>(x);
      sum[static_cast<std::size_t>(i)] += row[column] + (x - column) * (row[column + 1] - row[column]);
    }
  }
  for (std::size_t i = 2; i + 2 < sum.size(); ++i)
    changes.push_back(sum[i + 2] + 2 * sum[i + 1] - 2 * sum[i - 1] - sum[i - 2]);
  return changes;
}
} // namespace

std::optional<double> continuityAcross(const vpImage<unsigned char> &image, const BorderLine &line, Border border,
                                       double half_width_px)
{
  constexpr int kLeastRows = 40;
  constexpr double kOffInside = 1.5, kOffOutside = 2.5;             // [px]: the border itself is as wide
  constexpr double kOfHalfWidth = 0.8, kNarrowest = 2, kWidest = 8; // [1], [px], [px]: of a strip
  const double width = std::clamp(kOfHalfWidth * half_width_px, kNarrowest, kWidest);
  const double outwards = border == Border::left ? -1 : 1, reach = kOffOutside + width + 1;
  const double first = line.xAt(line.row_begin), last = line.xAt(line.row_end - 1);
  if (line.rows() < kLeastRows || std::min(first, last) < reach ||
      std::max(first, last) > static_cast<double>(image.getWidth()) - 1 - reach)
    return std::nullopt;
  const std::vector<double> in = changesAlong(image, line, -outwards * kOffInside, -outwards * width);
  const std::vector<double> out = changesAlong(image, line, outwards * kOffOutside, outwards * (kOffOutside + width));
  const auto n = static_cast<double>(in.size());
  double x = 0, y = 0, xx = 0, yy = 0, xy = 0;
  for (std::size_t i = 0; i < in.size(); ++i) {
    x += in[i];
    y += out[i];
    xx += in[i] * in[i];
    yy += out[i] * out[i];
    xy += in[i] * out[i];
  }
  const double noise = n * kChangesOfNoise;
  return (xy - x * y / n) / std::sqrt((xx - x * x / n + noise) * (yy - y * y / n + noise));
}

std::optional<double> continuityOf(const vpImage<unsigned char> &image, const PinholeCamera &camera,
                                   const RelativeTrunk &relative, const ElevationRange &part)
{
  double sum = 0;
  int count = 0;
  for (const Border border : kBorders)
    if (const auto one =
            continuityAcross(image, borderLine(camera, relative, border, part), border, camera.fx * relative.ratio())) {
      sum += *one;
      ++count;
    }
  return count > 0 ? std::optional(sum / count) : std::nullopt;
}
} // namespace bole
