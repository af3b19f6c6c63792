// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Figures in tables and sentences. What was not measured (NaN) is printed as "-", never as a number.

#include <cmath>
#include <fmt/format.h>
#include <string>

namespace bole
{
/// Prints \p value with \p decimals, right-aligned in \p width columns.
inline std::string figure(double value, int width, int decimals)
{
  return std::isnan(value) ? fmt::format("{:>{}}", "-", width) : fmt::format("{:{}.{}f}", value, width, decimals);
}

/// Prints the same with its sign.
inline std::string signedFigure(double value, int width, int decimals)
{
  return std::isnan(value) ? fmt::format("{:>{}}", "-", width) : fmt::format("{:+{}.{}f}", value, width, decimals);
}

/// Prints the share 0.741 as "74.1 %", or "-".
inline std::string percent(double share, int decimals = 1)
{
  return std::isnan(share) ? "-" : fmt::format("{:.{}f} %", 100 * share, decimals);
}

/// Prints "0.123 m", or "-".
inline std::string withUnit(double value, int decimals, const char *unit)
{
  return std::isnan(value) ? "-" : fmt::format("{:.{}f} {}", value, decimals, unit);
}
} // namespace bole
