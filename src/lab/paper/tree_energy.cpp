// SPDX-License-Identifier: GPL-2.0-or-later
#include "paper/tree_energy.h"

#include <Eigen/Dense>
#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace bole::paper
{
namespace
{
constexpr double kNoCurvature = 1e-6; ///< of an energy without borders, by rounding [1/px^2]
constexpr double kSettled_px = 0.02;  ///< a border that moves less stands
constexpr Border kBorders[] = {Border::left, Border::right};

cv::Mat blurred(const cv::Mat &part)
{
  constexpr double kSigma_px = 3; // Section 4.1
  cv::Mat result;
  cv::GaussianBlur(part, result, {}, kSigma_px, 0, cv::BORDER_REPLICATE);
  return result;
}

vpImage<float> asImage(const cv::Mat &values)
{
  vpImage<float> image(static_cast<unsigned>(values.rows), static_cast<unsigned>(values.cols));
  std::copy_n(values.ptr<float>(), image.getSize(), image.bitmap);
  return image;
}

/// A row between its columns, by the cubic through four of them.
struct CubicSample
{
  double value, slope;

  CubicSample(const float *row, double x)
  {
    const int column = static_cast<int>(x);
    const double t = x - column, p0 = row[column - 1], p1 = row[column], p2 = row[column + 1], p3 = row[column + 2];
    const double c1 = 0.5 * (p2 - p0), c2 = p0 - 2.5 * p1 + 2 * p2 - 0.5 * p3, c3 = 0.5 * (p3 - p0) + 1.5 * (p1 - p2);
    value = p1 + t * (c1 + t * (c2 + t * c3));
    slope = c1 + t * (2 * c2 + t * 3 * c3);
  }
};
} // namespace

SplitGradient splitGradient(const vpImage<unsigned char> &image)
{
  const cv::Mat grey(static_cast<int>(image.getRows()), static_cast<int>(image.getCols()), CV_8U, image.bitmap);
  cv::Mat sobel;
  cv::Sobel(grey, sobel, CV_32F, 1, 0, 3, 1.0 / (8 * 255.0), 0, cv::BORDER_REPLICATE);
  return {asImage(blurred(cv::min(sobel, 0.f))), asImage(blurred(cv::max(sobel, 0.f)))};
}

BorderInImage borderInImage(const PinholeCamera &camera, const RelativeTrunk &tree, Border border)
{
  constexpr double kLeastDepth = 1e-3, kMargin_px = 4; // a sample needs its neighbours
  const double s = std::min(tree.ratio(), 0.999), c = std::sqrt(1 - s * s), side = border == Border::left ? 1 : -1;
  const Eigen::Vector3d n(-s, side * c, 0), n_by_log_s(-s, -side * s * s / c, 0), cn = tree.cRt * n;
  BorderInImage line;
  line.slope = -camera.fx * cn.y() / (camera.fy * cn.x());
  if (!(std::abs(line.slope) < 1) || tree.borderDirection(border, 0).z() < kLeastDepth)
    return line;
  line.x = camera.cx - camera.fx / cn.x() * (cn.z() - cn.y() * camera.cy / camera.fy);
  double top = 1, bottom = camera.height - 2;
  const double low = kMargin_px, high = camera.width - 1 - kMargin_px;
  if (std::abs(line.slope) > 1e-9) {
    const auto [first, last] =
        std::minmax({(low - line.x) / line.slope, (high - line.x) / line.slope}); // a list: by value
    top = std::max(top, first);
    bottom = std::min(bottom, last);
  }
  else if (line.x < low || line.x > high)
    return line;
  if (!(bottom > top))
    return line;
  line.begin = static_cast<int>(std::ceil(top));
  line.end = static_cast<int>(std::floor(bottom)) + 1;
  // n . (x, y, 1) = 0 stays zero on a fixed row: dx = -(dn . (x, y, 1)) / n_x
  for (int i = 0; i < 3; ++i)
    line.by_tree.col(i) = tree.cRt * Eigen::Vector3d::Unit(i).cross(n);
  line.by_tree.col(3) = tree.cRt * n_by_log_s;
  line.by_tree *= -camera.fx / cn.x();
  return line;
}

Vector4d pixelSteps(const PinholeCamera &camera, const RelativeTrunk &tree)
{
  constexpr double kLongest = 0.1; // of an angle [rad] and of the log of r/d: farther the energy is another
  Vector4d most = Vector4d::Constant(1 / kLongest);
  for (const Border border : kBorders) {
    const BorderInImage line = borderInImage(camera, tree, border);
    if (line.begin < line.end)
      for (const int v : {line.begin, line.end - 1})
        most = most.cwiseMax((line.by_tree.transpose() * camera.ray({line.columnAt(v), v})).cwiseAbs());
  }
  return most.cwiseInverse();
}

double TreeEnergy::evaluate(const RelativeTrunk &tree, Vector4d *f) const
{
  double energy = 0;
  if (f)
    f->setZero();
  for (const Border border : kBorders) {
    const bool is_left = border == Border::left;
    const vpImage<float> &part = is_left ? m_gradient.negative : m_gradient.positive;
    const double weight = is_left ? m_alpha : -m_alpha;
    const BorderInImage line = borderInImage(m_camera, tree, border);
    double sum = 0;
    Eigen::Vector3d sideways = Eigen::Vector3d::Zero();
    for (int v = line.begin; v < line.end; ++v) {
      const CubicSample sample(part[v], line.columnAt(v));
      sum += sample.value;
      sideways += sample.slope * m_camera.ray({line.columnAt(v), v});
    }
    energy += weight * sum;
    if (f && line.begin < line.end)
      *f += weight * line.by_tree.transpose() * sideways;
  }
  return energy;
}

SummaryFactor TreeEnergy::expand(const RelativeTrunk &tree) const
{
  constexpr double kStep_px = 0.5; // of the central differences: a sixth of the blur of Eq. 3
  SummaryFactor summary;
  summary.optimum = tree;
  summary.energy = evaluate(tree, &summary.f);
  const Vector4d steps = kStep_px * pixelSteps(m_camera, tree);
  Matrix4d F;
  for (int i = 0; i < 4; ++i) {
    Vector4d plus, minus;
    evaluate(tree.plus(steps(i) * Vector4d::Unit(i)), &plus);
    evaluate(tree.plus(-steps(i) * Vector4d::Unit(i)), &minus);
    F.col(i) = (plus - minus) / (2 * steps(i));
  }
  // The gradient there belongs to the tangent there; what that differs from the tangent here is antisymmetric.
  summary.F = 0.5 * (F + F.transpose());
  return summary;
}

bool isConvex(const SummaryFactor &summary, const Vector4d &steps)
{
  const Matrix4d F = steps.asDiagonal() * summary.F * steps.asDiagonal();
  return F.allFinite() && Eigen::SelfAdjointEigenSolver<Matrix4d>(F).eigenvalues()(0) > kNoCurvature;
}

SummaryFactor convexified(SummaryFactor summary, const Vector4d &steps)
{
  constexpr double kMost_px = 1;
  const Eigen::SelfAdjointEigenSolver<Matrix4d> eigen(steps.asDiagonal() * summary.F * steps.asDiagonal());
  const Vector4d slope = eigen.eigenvectors().transpose() * steps.cwiseProduct(summary.f);
  const Vector4d curvature =
      eigen.eigenvalues().cwiseAbs().cwiseMax(slope.cwiseAbs() / kMost_px).cwiseMax(kNoCurvature);
  const Matrix4d V = steps.cwiseInverse().asDiagonal() * eigen.eigenvectors();
  summary.F = V * curvature.asDiagonal() * V.transpose();
  return summary;
}

std::optional<SummaryFactor> minimised(const TreeEnergy &energy, const RelativeTrunk &start)
{
  constexpr int kIterations = 50;
  if (!start.isFinite())
    return std::nullopt;
  SummaryFactor summary = energy.expand(start);
  for (int i = 0; i < kIterations; ++i) {
    const Vector4d steps = pixelSteps(energy.camera(), summary.optimum);
    if (!summary.f.allFinite() || !summary.F.allFinite())
      return std::nullopt;
    Vector4d step = -convexified(summary, steps).F.ldlt().solve(summary.f);
    const auto length_px = [&] { return step.cwiseQuotient(steps).cwiseAbs().maxCoeff(); };
    while (length_px() >= kSettled_px && !(energy.evaluate(summary.optimum.plus(step)) < summary.energy))
      step *= 0.5;
    if (!(length_px() >= kSettled_px))
      return isConvex(summary, steps) ? std::optional(summary) : std::nullopt;
    summary = energy.expand(summary.optimum.plus(step));
  }
  return std::nullopt;
}
} // namespace bole::paper
