// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/svg.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
namespace
{

std::string pointsText(const SvgPoints &points)
{
  std::string text;
  for (const auto &[x, y] : points)
    text += fmt::format("{:.1f},{:.1f} ", x, y);
  return text;
}
} // namespace

std::string escaped(const std::string &text)
{
  std::string xml;
  for (const char c : text)
    xml += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : c == '"' ? "&quot;" : std::string(1, c);
  return xml;
}

SvgDrawing::SvgDrawing(double width, double height)
    : m_text(fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" "
                         "viewBox=\"0 0 {0:.0f} {1:.0f}\" font-family=\"sans-serif\" font-size=\"11\">\n"
                         "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
                         width, height))
{
}

void SvgDrawing::line(double x0, double y0, double x1, double y1, const char *colour, const std::string &style)
{
  m_text += fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" {}/>\n", x0, y0,
                        x1, y1, colour, style);
}

void SvgDrawing::polyline(const SvgPoints &points, const char *colour, const std::string &style)
{
  if (!points.empty())
    m_text +=
        fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" {}/>\n", pointsText(points), colour, style);
}

void SvgDrawing::polygon(const SvgPoints &points, const char *colour, const std::string &style)
{
  m_text += fmt::format("<polygon points=\"{}\" fill=\"{}\" {}/>\n", pointsText(points), colour, style);
}

void SvgDrawing::circle(double x, double y, double radius, const char *fill, const std::string &style)
{
  m_text +=
      fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" fill=\"{}\" {}/>\n", x, y, radius, fill, style);
}

void SvgDrawing::box(double x, double y, double width, double height, const char *fill)
{
  m_text += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.2f}\" height=\"{:.1f}\" fill=\"{}\"/>\n", x, y,
                        width, height, fill);
}

void SvgDrawing::text(double x, double y, const std::string &text, const std::string &style)
{
  m_text += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" fill=\"#222\" {}>{}</text>\n", x, y, style, escaped(text));
}

std::string sigmaEllipse(double x, double y, const Eigen::Matrix2d &covariance, double scale, const char *colour)
{
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(covariance);
  const Eigen::Vector2d axes = 2 * scale * eigen.eigenvalues().cwiseMax(0).cwiseSqrt();
  const Eigen::Vector2d major = eigen.eigenvectors().col(1);
  return fmt::format("<ellipse rx=\"{0:.1f}\" ry=\"{1:.1f}\" transform=\"translate({2:.1f} {3:.1f}) rotate({4:.1f})\" "
                     "fill=\"{5}\" fill-opacity=\".15\" stroke=\"{5}\" stroke-opacity=\".6\"/>\n",
                     axes(1), axes(0), x, y, -std::atan2(major.y(), major.x()) * 180 / M_PI, colour);
}

std::vector<double> ticksBetween(double low, double high)
{
  const double raw = std::max(high - low, 1e-9) / 5, base = std::pow(10, std::floor(std::log10(raw)));
  const double step = base * (raw / base < 1.5 ? 1 : raw / base < 3.5 ? 2 : raw / base < 7.5 ? 5 : 10);
  constexpr int kMost = 12; // far from zero a step may change nothing
  const double first = std::ceil(low / step);
  std::vector<double> ticks;
  for (int i = 0; i < kMost && (first + i) * step <= high + 1e-9 * step; ++i)
    ticks.push_back((first + i) * step + 0.0); // no -0
  return ticks;
}

std::vector<double> gridBetween(double low, double high)
{
  constexpr double kMostLines = 300;
  if (!(high - low < kMostLines))
    return ticksBetween(low, high);
  std::vector<double> lines;
  for (double m = std::ceil(low); m <= high && lines.size() < kMostLines; ++m)
    lines.push_back(m);
  return lines;
}
} // namespace bole
