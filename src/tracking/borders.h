// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Both borders of a trunk, to go over.

#include <bole/trunk.h>

#include <array>

namespace bole
{
inline constexpr std::array<Border, 2> kBorders{Border::left, Border::right};
} // namespace bole
