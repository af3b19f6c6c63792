// SPDX-License-Identifier: GPL-2.0-or-later
#include "mbt/border_profile.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace bole
{
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace
{
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

/// Cuts the segment p + t (q - p), t in [t0, t1], to a (p + t (q - p)) >= b. False when nothing is left.
bool cut(double at_p, double at_q, double &t0, double &t1)
{
  if (at_p < 0 && at_q < 0)
    return false;
  if (at_p < 0)
    t0 = std::max(t0, at_p / (at_p - at_q));
  else if (at_q < 0)
    t1 = std::min(t1, at_p / (at_p - at_q));
  return t0 < t1;
}

float grey(const vpImage<unsigned char> &image, double u, double v)
{
  const int w = int(image.getWidth()), h = int(image.getHeight());
  const float x = float(std::min(std::max(u, 0.0), w - 1.001)), y = float(std::min(std::max(v, 0.0), h - 1.001));
  const int i = int(x), j = int(y);
  const float a = x - float(i), b = y - float(j);
  const unsigned char *row = image[unsigned(j)] + i, *below = row + w;
  return (1 - b) * ((1 - a) * row[0] + a * row[1]) + b * ((1 - a) * below[0] + a * below[1]);
}
} // namespace

std::optional<VisibleBorder> visibleBorder(const PinholeCamera &camera, const Cylinder &c,
                                           const RelativeTrunk &relative, Border side, double near_m, double margin_px)
{
  const ContactLine line = contactLine(c, relative, side);
  double t0 = 0, t1 = 1;
  if (!cut(line.foot.z() - near_m, line.top.z() - near_m, t0, t1))
    return std::nullopt;
  const Vector3d along = line.top - line.foot;
  VisibleBorder border;
  border.side = side;
  const Vector2d p = camera.project(line.foot + t0 * along), q = camera.project(line.foot + t1 * along);
  t0 = 0;
  t1 = 1;
  const double right = camera.width - 1 - margin_px, bottom = camera.height - 1 - margin_px;
  if (!cut(p.x() - margin_px, q.x() - margin_px, t0, t1) || !cut(right - p.x(), right - q.x(), t0, t1) ||
      !cut(p.y() - margin_px, q.y() - margin_px, t0, t1) || !cut(bottom - p.y(), bottom - q.y(), t0, t1))
    return std::nullopt;
  border.foot_px = p + t0 * (q - p);
  border.top_px = p + t1 * (q - p);
  const Vector3d n = relative.borderNormal(side);
  border.normal = Vector2d(n.x() / camera.fx, n.y() / camera.fy).normalized();
  return border;
}

std::vector<float> BorderProfile::whole() const
{
  std::vector<float> sum(std::size_t(width()), 0.f);
  float total = 0;
  for (int p = 0; p < pieces; ++p) {
    const float share = visible[std::size_t(p)];
    total += share;
    for (int k = 0; k < width(); ++k)
      sum[std::size_t(k)] += share * mean[std::size_t(p * width() + k)];
  }
  if (total > 0)
    for (float &v : sum)
      v /= total;
  return sum;
}

std::vector<float> BorderProfile::contrast(int piece) const
{
  const int n = width();
  const std::vector<float> all = piece < 0 ? whole() : std::vector<float>();
  const float *profile = piece < 0 ? all.data() : mean.data() + piece * n;
  std::vector<float> g(std::size_t(n), 0.f);
  for (int k = 2; k < n - 2; ++k) {
    float sum = 0;
    for (int i = 1; i <= 3; ++i)
      sum += kDerivative[std::size_t(i - 1)] * (profile[std::min(k + i, n - 1)] - profile[std::max(k - i, 0)]);
    g[std::size_t(k)] = sum;
  }
  return g;
}

BorderProfile sampleBorder(const vpImage<unsigned char> &image, const VisibleBorder &border, int half, int samples,
                           int pieces, const std::vector<bool> &hidden)
{
  BorderProfile profile;
  profile.half = half;
  profile.pieces = pieces;
  const int n = profile.width();
  profile.mean.assign(std::size_t(pieces * n), 0.f);
  profile.visible.assign(std::size_t(pieces), 0.f);
  profile.centre.assign(std::size_t(pieces), 0.0);
  std::vector<int> count(std::size_t(pieces), 0), total(std::size_t(pieces), 0);
  for (int k = 0; k < samples; ++k) {
    const std::size_t piece = std::size_t(k * pieces / samples);
    const double t = (k + 0.5) / samples;
    ++total[piece];
    if (!hidden.empty() && hidden[std::size_t(k)])
      continue;
    ++count[piece];
    profile.centre[piece] += t;
    const Vector2d start = border.at(t) - half * border.normal;
    float *row = profile.mean.data() + piece * std::size_t(n);
    for (int i = 0; i < n; ++i)
      row[i] += grey(image, start.x() + i * border.normal.x(), start.y() + i * border.normal.y());
  }
  for (int p = 0; p < pieces; ++p) {
    const std::size_t piece = std::size_t(p);
    if (count[piece] == 0)
      continue;
    profile.visible[piece] = float(count[piece]) / float(total[piece]);
    profile.centre[piece] /= count[piece];
    for (int i = 0; i < n; ++i)
      profile.mean[piece * std::size_t(n) + std::size_t(i)] /= float(count[piece]);
  }
  return profile;
}

std::vector<ContrastPeak> contrastPeaks(const std::vector<float> &g)
{
  std::vector<ContrastPeak> peaks;
  const int n = int(g.size()), half = n / 2;
  for (int k = 1; k + 1 < n; ++k) {
    const double a = std::abs(g[std::size_t(k - 1)]), b = std::abs(g[std::size_t(k)]),
                 c = std::abs(g[std::size_t(k + 1)]);
    if (!(b > a && b >= c) || b <= 0)
      continue;
    const double curvature = a - 2 * b + c;
    const double shift = curvature < 0 ? std::clamp(0.5 * (a - c) / curvature, -0.5, 0.5) : 0.0;
    peaks.push_back({k - half + shift, g[std::size_t(k)]});
  }
  return peaks;
}
} // namespace bole
