// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Curves that a benchmark has measured, as a table that `src/doc/figures.py curves` draws.

#include <fmt/ostream.h>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

namespace bole::test
{
using Curve = std::vector<std::pair<double, double>>;

/// A row a point: the name of its curve, x, y; \p title stands over the names.
inline void writeCurves(const std::string &path, const char *title, const char *x_name, const char *y_name,
                        const std::vector<std::pair<const char *, Curve>> &curves)
{
  std::ofstream out(path);
  fmt::print(out, "{},{},{}\n", title, x_name, y_name);
  for (const auto &[name, points] : curves)
    for (const auto &[x, y] : points)
      fmt::print(out, "{},{:.9g},{:.9g}\n", name, x, y);
}
} // namespace bole::test
