// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The median of a handful of measurements.

#include <vector>

namespace bole
{
/// The upper one of the two in the middle where the count is even; 0 of none.
double medianOf(std::vector<double> values);
} // namespace bole
