// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The map and the charts of the page, as SVG.

#include "report/run_record.h"

#include <string>

namespace bole
{
/// The map with the boxes that show and hide its layers. Trunks are groups of class `trunk` with their id as
/// `data-id`; one metre is 100 units, the world's y points up.
std::string mapHtml(const RunRecord &run);

/// Range, radius and place of a trunk over time, each with its sigma; \p truth may be nullptr.
std::string trunkCharts(const RunRecord &run, const TrunkRecord &trunk, const TruthTrunk *truth);
/// A row each for frames, sensors that contradict the others, and trunks, over time.
std::string timeLine(const RunRecord &run);
/// Standard deviation of the online place and its height over time, with the error where there is a truth.
std::string trajectoryCharts(const RunRecord &run);
/// Cost of each frame.
std::string timingChart(const RunRecord &run);
} // namespace bole
