// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The map of trunks as tables that spreadsheets, R and pandas read.

#include <bole/trunk_record.h>

#include <string>
#include <vector>

namespace bole
{
/// First line of `trunks.csv`: the names of the columns. The second line holds their units and begins with '#':
/// read.csv(file, comment.char = "#") in R, pandas.read_csv(file, comment="#").
extern const char *const kTrunksCsvHeader;

/// The confirmed trunks of \p map, a line each, atomically.
void writeTrunks(const std::string &path, const std::vector<TrunkRecord> &map);

/// The rest of \p map, with a column that tells why each is no trunk, atomically.
void writeHypotheses(const std::string &path, const std::vector<TrunkRecord> &map);

/// Reads what either of them wrote. Errors: vpException with file:line.
std::vector<TrunkRecord> readTrunks(const std::string &path);

/// For a camera that only rotated: what is known of the trunks as it sees them from \p from, the place of the camera.
/// A line each: id, status, bearing and width with their standard deviations, views. No lengths.
void writeBearings(const std::string &path, const std::vector<TrunkRecord> &map, const Eigen::Vector2d &from);
} // namespace bole
