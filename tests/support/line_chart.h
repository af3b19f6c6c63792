// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A line chart as SVG text, for the figures of the benchmarks.

#include <cmath>
#include <fmt/core.h>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

namespace bole::test
{
struct LineChart
{
  struct Line
  {
    std::string name, colour;
    std::vector<std::pair<double, double>> points;
  };
  std::string title, x_name, y_name;
  bool log_x = false, log_y = false;
  double x_min = 0, x_max = 1, y_min = 0, y_max = 1;
  std::vector<double> x_ticks, y_ticks;
  std::vector<Line> lines;

  double place(double v, double low, double high, bool logarithmic) const
  {
    if (logarithmic)
      return (std::log(std::max(v, low)) - std::log(low)) / (std::log(high) - std::log(low));
    return (v - low) / (high - low);
  }
  double px(double x) const { return 70 + 500 * place(x, x_min, x_max, log_x); }
  double py(double y) const { return 330 - 280 * place(y, y_min, y_max, log_y); }

  void write(const std::string &path) const
  {
    std::ofstream out(path);
    out << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"720\" height=\"390\" "
           "font-family=\"sans-serif\" "
           "font-size=\"13\"><rect width=\"720\" height=\"390\" fill=\"white\"/>\n";
    out << fmt::format("<text x=\"70\" y=\"28\" font-size=\"15\">{}</text>\n", title);
    for (const double x : x_ticks)
      out << fmt::format("<line x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"50\" y2=\"330\" "
                         "stroke=\"#ddd\"/><text x=\"{0:.1f}\" "
                         "y=\"348\" text-anchor=\"middle\">{1:g}</text>\n",
                         px(x), x);
    for (const double y : y_ticks)
      out << fmt::format("<line x1=\"70\" x2=\"570\" y1=\"{0:.1f}\" y2=\"{0:.1f}\" "
                         "stroke=\"#ddd\"/><text x=\"64\" "
                         "y=\"{2:.1f}\" text-anchor=\"end\">{1:g}</text>\n",
                         py(y), y, py(y) + 4);
    out << fmt::format("<text x=\"320\" y=\"372\" text-anchor=\"middle\">{}</text>\n", x_name);
    out << fmt::format("<text transform=\"translate(18 190) rotate(-90)\" text-anchor=\"middle\">{}</text>\n", y_name);
    double legend = 70;
    for (const Line &line : lines) {
      out << fmt::format("<polyline fill=\"none\" stroke-width=\"1.8\" stroke=\"{}\" points=\"", line.colour);
      for (const auto &[x, y] : line.points)
        out << fmt::format("{:.1f},{:.1f} ", px(x), py(y));
      out << fmt::format("\"/><text x=\"580\" y=\"{:.0f}\" fill=\"{}\">{}</text>\n", legend, line.colour, line.name);
      legend += 20;
    }
    out << "</svg>\n";
  }
};
} // namespace bole::test
