// SPDX-License-Identifier: GPL-2.0-or-later
#include "gradient/border_line.h"

#include "gradient/line_loops.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace bole
{
using Eigen::Vector3d;

BorderLine BorderLine::moved(double top, double bottom) const
{
  BorderLine line = *this;
  line.x_top += top;
  if (rows() > 1)
    line.slope += (bottom - top) / (rows() - 1);
  return line;
}

namespace
{
constexpr double kMinDepth = 1e-3;

/// Keeps the part of the segment of directions low..high that lies in front of the camera.
bool clipToFront(Vector3d &low, Vector3d &high)
{
  if (low.z() < kMinDepth && high.z() < kMinDepth)
    return false;
  const auto cut = [](Vector3d &behind, const Vector3d &front) {
    const double k = (kMinDepth - behind.z()) / (front.z() - behind.z());
    behind += k * (front - behind);
  };
  if (low.z() < kMinDepth)
    cut(low, high);
  if (high.z() < kMinDepth)
    cut(high, low);
  return true;
}
} // namespace

BorderLine clippedLine(const PinholeCamera &camera, const Vector3d &cn, const Vector3d &low, const Vector3d &high,
                       double margin_px, double most_slope)
{
  BorderLine line;
  Vector3d foot = low, top = high;
  const double slope = -camera.fx * cn.y() / (camera.fy * cn.x());
  if (!clipToFront(foot, top) || !(std::abs(slope) < most_slope))
    return line;

  double v0 = camera.project(top).y(), v1 = camera.project(foot).y();
  if (v0 > v1)
    std::swap(v0, v1);
  const double x_origin = camera.cx - camera.fx / cn.x() * (cn.z() - cn.y() * camera.cy / camera.fy); // x at v = 0
  v0 = std::max(v0, 1.0);
  v1 = std::min(v1, camera.height - 2.0);
  const double x_low = margin_px, x_high = camera.width - 1 - margin_px;
  if (std::abs(slope) > 1e-9) {
    const double va = (x_low - x_origin) / slope, vb = (x_high - x_origin) / slope;
    v0 = std::max(v0, std::min(va, vb));
    v1 = std::min(v1, std::max(va, vb));
  }
  else if (x_origin < x_low || x_origin > x_high)
    return line;
  if (!(v1 > v0))
    return line;
  line.row_begin = static_cast<int>(std::ceil(v0));
  line.row_end = static_cast<int>(std::floor(v1)) + 1;
  line.slope = slope;
  line.x_top = x_origin + slope * line.row_begin;
  return line;
}

BorderLine borderLine(const PinholeCamera &camera, const RelativeTrunk &relative, Border border,
                      const ElevationRange &range)
{
  return clippedLine(camera, relative.borderNormal(border), relative.borderDirection(border, range.low),
                     relative.borderDirection(border, range.high));
}

Eigen::Matrix<double, 2, 4> borderJacobian(const PinholeCamera &camera, const RelativeTrunk &relative, Border border,
                                           const BorderLine &line)
{
  const double s = std::min(relative.ratio(), 0.999), c = std::sqrt(1 - s * s);
  const double side = border == Border::left ? 1 : -1;
  const Vector3d tn(-s, side * c, 0), tn_by_log_s(-s, -side * s * s / c, 0);

  Eigen::Matrix<double, 3, 4> cn_by_theta; // of the normal: cRt (phi x n) and cRt dn/dlog s
  for (int i = 0; i < 3; ++i)
    cn_by_theta.col(i) = relative.cRt * Vector3d::Unit(i).cross(tn);
  cn_by_theta.col(3) = relative.cRt * tn_by_log_s;
  const Vector3d cn = relative.cRt * tn;

  // n . (x, y, 1) = 0 stays zero on a fixed row: dx = -(dn . (x, y, 1)) / n_x
  Eigen::Matrix<double, 2, 4> J;
  const double ends[2] = {static_cast<double>(line.row_begin), static_cast<double>(line.row_end - 1)};
  for (int i = 0; i < 2; ++i)
    J.row(i) = -camera.fx / cn.x() * camera.ray({line.xAt(ends[i]), ends[i]}).transpose() * cn_by_theta;
  return J;
}

namespace
{
LineSamples samplesOf(const vpImage<float> &g, const BorderLine &line)
{
  return {g[line.row_begin], static_cast<int>(g.getCols()), line.rows(), line.x_top, line.slope};
}
} // namespace

MeanGradient meanAlong(const vpImage<float> &g, const BorderLine &line)
{
  const int rows = line.rows();
  if (rows == 0)
    return {};
  const CubicSums sums = cubicSumsAlong(samplesOf(g, line));
  const double by_bottom = rows > 1 ? sums.slope_by_row / (rows - 1) : 0;
  return {sums.value / rows, (sums.slope - by_bottom) / rows, by_bottom / rows};
}

double meanAlongOnly(const vpImage<float> &g, const BorderLine &line)
{
  return line.rows() > 0 ? linearSumAlong(samplesOf(g, line)) / line.rows() : 0;
}

double evennessAlong(const vpImage<float> &g, const BorderLine &line, double sign)
{
  constexpr int kParts = 8;
  double sum = 0, squares = 0;
  for (int part = 0; part < kParts; ++part) {
    BorderLine piece = line;
    piece.row_begin = line.row_begin + part * line.rows() / kParts;
    piece.row_end = line.row_begin + (part + 1) * line.rows() / kParts;
    piece.x_top = line.xAt(piece.row_begin);
    double strongest = 0;
    if (piece.rows() > 0) {
      const LinearSums sums = linearSumsBeside(samplesOf(g, piece)); // bow and taper
      strongest = std::max({sign * sums.left, sign * sums.middle, sign * sums.right}) / piece.rows();
    }
    sum += strongest;
    squares += strongest * strongest;
  }
  return sum > 0 ? sum * sum / (kParts * squares) : 0;
}
} // namespace bole
