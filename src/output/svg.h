// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Drawings as SVG text.

#include <Eigen/Core>

#include <string>
#include <utility>
#include <vector>

namespace bole
{
using SvgPoints = std::vector<std::pair<double, double>>;

/// \p text as it may stand in XML and HTML.
std::string escaped(const std::string &text);

/// Shapes on a white sheet. Coordinates [px], y down.
class SvgDrawing
{
public:
  SvgDrawing(double width, double height);

  /// \p style: further attributes, such as `fill-opacity=".5"`.
  void line(double x0, double y0, double x1, double y1, const char *colour, const std::string &style = {});
  void polyline(const SvgPoints &points, const char *colour, const std::string &style = {});
  void polygon(const SvgPoints &points, const char *colour, const std::string &style = {});
  void circle(double x, double y, double radius, const char *fill, const std::string &style = {});
  void box(double x, double y, double width, double height, const char *fill);
  void text(double x, double y, const std::string &text, const std::string &style = {});
  void add(const std::string &element) { m_text += element; }
  std::string finish() const { return m_text + "</svg>\n"; }

private:
  std::string m_text;
};

/// Two sigma of \p covariance round the point (\p x, \p y) of the drawing, \p scale px for one of its units; its second
/// axis points up.
std::string sigmaEllipse(double x, double y, const Eigen::Matrix2d &covariance, double scale, const char *colour);

/// Values of ticks between \p low and \p high, about five.
std::vector<double> ticksBetween(double low, double high);
/// Every metre between \p low and \p high; of a map of more than 300 m those of ticksBetween().
std::vector<double> gridBetween(double low, double high);
} // namespace bole
