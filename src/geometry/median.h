// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Median and quantiles of a handful of measurements, and the peak between three samples.

#include <Eigen/Core>
#include <vector>

namespace bole
{
/// The upper one of the two in the middle where the count is even; 0 of none.
double medianOf(std::vector<double> values);
/// The median of each coordinate by itself, as medianOf().
Eigen::Vector2d medianByAxis(const std::vector<Eigen::Vector2d> &values);
/// The mean of the two in the middle where the count is even; NaN of none.
double centreOf(std::vector<double> values);
/// The one of \p values below which the part \p share of them stays, 0 to 1: the nearest rank; NaN of none.
double quantileOf(std::vector<double> values, double share);

/// Where the parabola through three samples has its peak, from the middle one: -0.5 to 0.5 of their spacing; 0 where it
/// has none.
double peakOffset(double before, double middle, double after);
} // namespace bole
