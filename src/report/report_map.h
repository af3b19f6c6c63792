// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The map of the page: an SVG in which the page's script zooms and pans.

#include "report/run_record.h"

#include <string>

namespace bole
{
/// The map with the boxes that show and hide its layers. Trunks are groups of class `trunk` with their id as
/// `data-id`; one metre is 100 units, the world's y points up.
std::string mapHtml(const RunRecord &run);
} // namespace bole
