// SPDX-License-Identifier: GPL-2.0-or-later
#include "mbt/rotation_aligner.h"
#include "geometry/so3.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace bole
{
using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace
{
/// Pixels of an image a pixel of its coarse thumbnail, which is about 40 pixels wide; the fine one has twice as many.
int coarseFactor(int width) { return 8 * std::max(1, (width + 160) / 320); }

Thumbnail shrink(const vpImage<unsigned char> &image, int factor)
{
  Thumbnail small;
  small.width = int(image.getWidth()) / factor;
  small.height = int(image.getHeight()) / factor;
  small.grey.assign(std::size_t(small.width * small.height), 0.f);
  for (int v = 0; v < small.height; ++v) {
    float *out = small.grey.data() + v * small.width;
    for (int j = 0; j < factor; ++j) {
      const unsigned char *row = image[unsigned(v * factor + j)];
      for (int u = 0; u < small.width; ++u) {
        int sum = 0;
        for (int i = 0; i < factor; ++i)
          sum += row[u * factor + i];
        out[u] += float(sum);
      }
    }
  }
  const float scale = 1.f / float(factor * factor);
  for (float &g : small.grey)
    g *= scale;
  return small;
}

/// Sums of a normalised cross-correlation.
struct Correlation
{
  double a = 0, b = 0, aa = 0, bb = 0, ab = 0;
  int n = 0;
  void add(double x, double y)
  {
    a += x, b += y, aa += x * x, bb += y * y, ab += x * y;
    ++n;
  }
  double value() const
  {
    if (n < 16)
      return -1;
    const double va = aa - a * a / n, vb = bb - b * b / n;
    return va > 1e-6 * n && vb > 1e-6 * n ? (ab - a * b / n) / std::sqrt(va * vb) : 0;
  }
};

double shiftedCorrelation(const Thumbnail &first, const Thumbnail &second, int du, int dv)
{
  float a = 0, b = 0, aa = 0, bb = 0, ab = 0;
  const int u0 = std::max(0, -du), u1 = std::min(first.width, first.width - du);
  const int v0 = std::max(0, -dv), v1 = std::min(first.height, first.height - dv);
  for (int v = v0; v < v1; ++v) {
    const float *x = first.grey.data() + v * first.width, *y = second.grey.data() + (v + dv) * first.width + du;
    for (int u = u0; u < u1; ++u) {
      a += x[u], b += y[u];
      aa += x[u] * x[u], bb += y[u] * y[u], ab += x[u] * y[u];
    }
  }
  const float n = float(std::max(1, (u1 - u0) * (v1 - v0)));
  const float va = aa - a * a / n, vb = bb - b * b / n;
  return va > n && vb > n ? (ab - a * b / n) / std::sqrt(va * vb) : -1;
}

PinholeCamera thumbnailCamera(const PinholeCamera &camera, int factor)
{
  PinholeCamera small = camera;
  small.fx /= factor, small.fy /= factor;
  small.cx = (camera.cx + 0.5) / factor - 0.5;
  small.cy = (camera.cy + 0.5) / factor - 0.5;
  small.width = camera.width / factor, small.height = camera.height / factor;
  return small;
}

bool sample(const Thumbnail &t, double u, double v, float &grey, float &gu, float &gv)
{
  if (!(u >= 1 && v >= 1 && u < t.width - 2 && v < t.height - 2))
    return false;
  const int i = int(u), j = int(v);
  const float a = float(u - i), b = float(v - j);
  const float *p = t.grey.data() + j * t.width + i, *q = p + t.width;
  grey = (1 - b) * ((1 - a) * p[0] + a * p[1]) + b * ((1 - a) * q[0] + a * q[1]);
  gu = (1 - b) * (p[1] - p[0]) + b * (q[1] - q[0]);
  gv = (1 - a) * (q[0] - p[0]) + a * (q[1] - p[1]);
  return true;
}

/// One Gauss-Newton step of second(pi(R ray)) = gain-free first; false when it cannot be solved.
bool refine(const Thumbnail &first, const Thumbnail &second, const PinholeCamera &camera, double outlier, Matrix3d &R,
            double &step)
{
  Matrix3d H = Matrix3d::Zero();
  Vector3d b = Vector3d::Zero();
  double bias = 0;
  int n = 0;
  float grey, gu, gv;
  for (int pass = 0; pass < 2; ++pass) {
    for (int v = 1; v < first.height - 1; v += 2 - pass)
      for (int u = 1; u < first.width - 1; u += 2 - pass) {
        const Vector3d p = R * camera.ray({double(u), double(v)});
        if (p.z() < 0.1)
          continue;
        const double x = p.x() / p.z(), y = p.y() / p.z();
        if (!sample(second, camera.fx * x + camera.cx, camera.fy * y + camera.cy, grey, gu, gv))
          continue;
        const double difference = grey - first.at(u, v);
        if (pass == 0) {
          bias += difference, ++n;
          continue;
        }
        const double error = difference - bias;
        const double weight = std::abs(error) <= outlier ? 1 : outlier / std::abs(error);
        // d(x, y) under p -> p + w x p
        const double gx = gu * camera.fx, gy = gv * camera.fy;
        const Vector3d J(-gx * x * y - gy * (1 + y * y), gx * (1 + x * x) + gy * x * y, -gx * y + gy * x);
        H += weight * J * J.transpose();
        b -= weight * J * error;
      }
    if (pass == 0) {
      if (n < 50)
        return false;
      bias /= n;
    }
  }
  const Vector3d w = (H + 1e-3 * H.trace() * Matrix3d::Identity()).ldlt().solve(b);
  if (!w.allFinite() || w.norm() > 0.2)
    return false;
  R = orthonormalized(expSo3(w) * R);
  step = w.norm();
  return true;
}
} // namespace

RotationAligner::RotationAligner(const Options &options) : m_options(options) {}

RotationAligner::Reference RotationAligner::reduce(const vpImage<unsigned char> &image)
{
  const int factor = coarseFactor(int(image.getWidth()));
  return {shrink(image, factor), shrink(image, factor / 2)};
}

double RotationAligner::correlation(const Reference &first, const Reference &second, const PinholeCamera &camera,
                                    const Matrix3d &c2Rc1)
{
  const PinholeCamera small = thumbnailCamera(camera, coarseFactor(camera.width));
  Correlation sums;
  float grey, gu, gv;
  for (int v = 0; v < first.coarse.height; ++v)
    for (int u = 0; u < first.coarse.width; ++u) {
      const Vector3d p = c2Rc1 * small.ray({double(u), double(v)});
      if (p.z() < 0.1)
        continue;
      const Eigen::Vector2d q = small.project(p);
      if (sample(second.coarse, q.x(), q.y(), grey, gu, gv))
        sums.add(first.coarse.at(u, v), grey);
    }
  return sums.value();
}

RotationAlignment RotationAligner::align(const Reference &first, const Reference &second,
                                         const PinholeCamera &camera) const
{
  RotationAlignment result;
  if (first.empty() || second.empty() || first.fine.grey.size() != second.fine.grey.size())
    return result;
  const int factor = coarseFactor(camera.width);
  const int max_du = int(std::ceil(m_options.max_turn_px / factor));
  const int max_dv = int(std::ceil(m_options.max_tilt_px / factor));
  int best_u = 0, best_v = 0;
  double best = -2;
  for (int dv = -max_dv; dv <= max_dv; ++dv)
    for (int du = -max_du; du <= max_du; ++du) {
      const double score =
          shiftedCorrelation(first.coarse, second.coarse, du, dv) - 0.002 * (std::abs(du) + std::abs(dv));
      if (score > best)
        best = score, best_u = du, best_v = dv;
    }
  const PinholeCamera coarse = thumbnailCamera(camera, factor), fine = thumbnailCamera(camera, factor / 2);
  result.c2Rc1 = expSo3({-std::atan(best_v / coarse.fy), std::atan(best_u / coarse.fx), 0});
  double step = 1;
  for (int i = 0; i < m_options.iterations && step > 1e-4; ++i) {
    const bool first_half = i < m_options.iterations / 3;
    if (!refine(first_half ? first.coarse : first.fine, first_half ? second.coarse : second.fine,
                first_half ? coarse : fine, 12, result.c2Rc1, step))
      break;
    if (first_half)
      step = 1;
  }
  result.correlation = correlation(first, second, camera, result.c2Rc1);
  result.ok = result.correlation >= m_options.min_correlation;
  return result;
}
} // namespace bole
