// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// One line of an Options::validate().

namespace bole
{
/// \throw vpException "name = value, must be in [low, high]", also where \p value is NaN.
void requireRange(const char *name, double value, double low, double high);
} // namespace bole
