// SPDX-License-Identifier: GPL-2.0-or-later
#include "tracking/border_profile.h"

#include "geometry/median.h"
#include "tracking/tracking_loops.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <type_traits>

namespace bole
{
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace
{
constexpr double kStep_px = 0.5; ///< of meanAcross()

/// Derivative of a Gaussian of sigma 1 px, normalised so that a unit ramp gives 1.
const std::array<float, 3> kDerivative = [] {
  std::array<float, 3> k{};
  double ramp = 0;
  for (int i = 1; i <= 3; ++i) {
    k[std::size_t(i - 1)] = float(i * std::exp(-0.5 * i * i));
    ramp += 2.0 * i * k[std::size_t(i - 1)];
  }
  for (float &v : k)
    v = float(v / ramp);
  return k;
}();

/// sum[k] += image(x - half + k) of the \p size pixels at \p pixels, linear between them.
template <class Pixel> void addPixels(const Pixel *pixels, int size, double x, int half, float *__restrict sum)
{
  const double whole = std::floor(x);
  const int first = int(whole) - half, n = 2 * half + 1;
  const float b = float(x - whole), a = 1 - b;
  if (first >= 0 && first + n < size) {
    const Pixel *p = pixels + first;
    for (int k = 0; k < n; ++k)
      sum[k] += a * float(p[k]) + b * float(p[k + 1]);
    return;
  }
  const auto at = [&](int i) {
    if constexpr (std::is_floating_point_v<Pixel>)
      return i >= 0 && i < size ? float(pixels[i]) : 0.f;
    else
      return float(pixels[std::clamp(i, 0, size - 1)]);
  };
  for (int k = 0; k < n; ++k)
    sum[k] += a * at(first + k) + b * at(first + k + 1);
}
} // namespace

double ImageBorder::length() const { return line.rows() * std::sqrt(1 + line.slope * line.slope); }

Vector2d ImageBorder::at(double row, double offset_px) const
{
  const double across = line.xAt(row) + offset_px;
  return is_flat ? Vector2d(row, across) : Vector2d(across, row);
}

ImageBorder imageBorder(const PinholeCamera &camera, const Vector3d &cn, const Vector3d &foot, const Vector3d &top,
                        double margin_px)
{
  ImageBorder border;
  border.line = clippedLine(camera, cn, foot, top, margin_px, 1);
  if (border.isVisible())
    return border;
  PinholeCamera turned = camera; // the image with its axes exchanged
  std::swap(turned.fx, turned.fy);
  std::swap(turned.cx, turned.cy);
  std::swap(turned.width, turned.height);
  const auto exchanged = [](const Vector3d &v) { return Vector3d(v.y(), v.x(), v.z()); };
  border.line = clippedLine(turned, exchanged(cn), exchanged(foot), exchanged(top), margin_px, 1);
  border.is_flat = true;
  return border;
}

void addAcross(const vpImage<unsigned char> &image, const ImageBorder &border, int row, int half, float *sum)
{
  const double x = border.line.xAt(row);
  const int width = int(image.getWidth()), height = int(image.getHeight());
  if (!border.is_flat) {
    addPixels(image[unsigned(row)], width, x, half, sum);
    return;
  }
  const int first = std::clamp(int(std::floor(x)) - half, 0, height - 1);
  const int last = std::clamp(int(std::floor(x)) + half + 1, 0, height - 1);
  thread_local std::vector<unsigned char> column;
  column.resize(std::size_t(height));
  for (int v = first; v <= last; ++v)
    column[std::size_t(v)] = image[unsigned(v)][row];
  addPixels(column.data() + first, last - first + 1, x - first, half, sum);
}

std::vector<float> meanAcross(const vpImage<float> &g, const BorderLine &line, double half_px)
{
  constexpr int kTogether = 8; // offsets that are worked on at once
  const int steps = int(std::ceil(half_px / kStep_px)), half = (steps + 1) / 2, n = 2 * half + 1;
  const int padded = (n + kTogether - 1) / kTogether * kTogether, columns = int(g.getCols());
  thread_local std::vector<float> whole, between;
  whole.assign(std::size_t(padded), 0.f);
  between.assign(std::size_t(padded), 0.f);
  std::vector<float> mean;
  const LineSamples across{line.rows() > 0 ? g[line.row_begin] : nullptr, columns, line.rows(), line.x_top, line.slope};
  for (int i = 0; i < line.rows(); ++i) {
    i = addAcrossRows(across, i, padded, half, whole.data(), between.data());
    if (i == line.rows())
      break;
    const float *row = g[line.row_begin + i]; // reaches beyond the image
    const double x = line.x_top + line.slope * i;
    addPixels(row, columns, x, half, whole.data());
    addPixels(row, columns, x + kStep_px, half, between.data());
  }
  const float scale = line.rows() > 0 ? 1 / float(line.rows()) : 0;
  mean.reserve(std::size_t(2 * steps + 1));
  for (int k = 2 * half - steps; k <= 2 * half + steps; ++k)
    mean.push_back(scale * (k % 2 == 0 ? whole : between)[std::size_t(k / 2)]);
  return mean;
}

void differentiate(const std::vector<float> &profile, std::vector<float> &contrast)
{
  contrast.assign(profile.size(), 0.f);
  const float *p = profile.data();
  for (std::size_t k = 3; k + 3 < profile.size(); ++k)
    contrast[k] = kDerivative[0] * (p[k + 1] - p[k - 1]) + kDerivative[1] * (p[k + 2] - p[k - 2]) +
                  kDerivative[2] * (p[k + 3] - p[k - 3]);
}

std::vector<BorderPeak> peaksOf(const std::vector<float> &contrast, double step_px, double least)
{
  std::vector<BorderPeak> peaks;
  const int n = int(contrast.size()), middle = n / 2;
  peaks.reserve(contrast.size() / 2); // no two stand side by side
  for (int k = 1; k + 1 < n; ++k) {
    const float *at = contrast.data() + k;
    const double a = std::abs(at[-1]), b = std::abs(at[0]), c = std::abs(at[1]);
    if (b < least || b < a || b <= c)
      continue;
    const double shift = peakOffset(a, b, c);
    const double height = b - 0.25 * (a - c) * shift;
    peaks.push_back({(k - middle + shift) * step_px, std::copysign(height, double(at[0]))});
  }
  return peaks;
}

double contrastCost(double contrast, const std::optional<double> &before)
{
  constexpr double kChanged = 2; // -log of how often light, shade or what stands behind gives a border another contrast
  if (before) {
    const double sigma = 0.3 * std::abs(*before) + 0.01;
    const double z = (contrast - *before) / sigma;
    return std::min(0.5 * z * z, kChanged);
  }
  return 4 - 2 * std::min(std::abs(contrast) / 0.03, 2.0);
}

std::vector<BorderPeak> scanBorder(const vpImage<float> &g, const BorderLine &line, double half_width_px,
                                   double contrast_min, std::size_t most)
{
  std::vector<BorderPeak> peaks = peaksOf(meanAcross(g, line, half_width_px + kStep_px), kStep_px, contrast_min);
  std::sort(peaks.begin(), peaks.end(),
            [](const BorderPeak &p, const BorderPeak &q) { return std::abs(p.contrast) > std::abs(q.contrast); });
  if (peaks.size() > most)
    peaks.resize(most);
  return peaks;
}

std::vector<PeakPair> pairPeaks(const std::vector<BorderPeak> &left, const std::vector<BorderPeak> &right,
                                const PairPrior &prior, std::size_t most)
{
  std::vector<PeakPair> pairs;
  pairs.reserve(std::max<std::size_t>(left.size(), 1) * std::max<std::size_t>(right.size(), 1));
  if (!left.empty() && !right.empty()) {
    const Eigen::Matrix2d information = prior.covariance_px.inverse();
    for (const BorderPeak &l : left)
      for (const BorderPeak &r : right) {
        const Eigen::Vector2d offset(l.offset_px, r.offset_px);
        pairs.push_back({l, r,
                         0.5 * offset.dot(information * offset) + contrastCost(l.contrast, prior.left_contrast) +
                             contrastCost(r.contrast, prior.right_contrast)});
      }
  }
  else {
    const int side = left.empty() ? 1 : 0;
    const double variance = prior.covariance_px(side, side);
    for (const BorderPeak &p : side == 0 ? left : right) {
      const double cost = 0.5 * p.offset_px * p.offset_px / variance +
                          contrastCost(p.contrast, side == 0 ? prior.left_contrast : prior.right_contrast);
      pairs.push_back(side == 0 ? PeakPair{p, {}, cost} : PeakPair{{}, p, cost});
    }
  }
  std::sort(pairs.begin(), pairs.end(), [](const PeakPair &p, const PeakPair &q) { return p.cost < q.cost; });
  if (pairs.size() > most)
    pairs.resize(most);
  return pairs;
}
} // namespace bole
