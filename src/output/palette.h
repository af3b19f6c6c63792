// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The colours of all pictures: those of Okabe and Ito, which colour-blind readers tell apart.

#include <array>

namespace bole
{
namespace palette
{
constexpr const char *kBlack = "#000000", *kOrange = "#e69f00", *kSkyBlue = "#56b4e9", *kGreen = "#009e73",
                     *kYellow = "#f0e442", *kBlue = "#0072b2", *kVermilion = "#d55e00", *kPurple = "#cc79a7",
                     *kGrey = "#999999";
/// For the lines of a chart, one after the other.
constexpr std::array<const char *, 8> kLines = {kBlue, kVermilion, kGreen, kPurple, kOrange, kSkyBlue, kBlack, kYellow};
} // namespace palette
} // namespace bole
