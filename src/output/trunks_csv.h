// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The map of trunks as tables that spreadsheets, R and pandas read.

#include <bole/trunk_record.h>

#include <string>
#include <vector>

namespace bole
{
/// The first line of `trunks.csv` holds the names of the columns. The second line holds their units and begins with
/// '#': read.csv(file, comment.char = "#") in R, pandas.read_csv(file, comment="#").
extern const char *const kTrunksCsvHeader;

/// Writes the confirmed trunks of \p map, a line each, atomically.
void writeTrunks(const std::string &path, const std::vector<TrunkRecord> &map);

/// Writes the rest of \p map, with a column that tells why each is no trunk, atomically.
void writeHypotheses(const std::string &path, const std::vector<TrunkRecord> &map);

/// Reads what either of them wrote. Errors: vpException with file:line.
std::vector<TrunkRecord> readTrunks(const std::string &path);

/// Writes what a camera that only rotated at the place \p from knows of the trunks, a line each: id, status, bearing
/// and width with their standard deviations, views. It holds no lengths.
void writeBearings(const std::string &path, const std::vector<TrunkRecord> &map, const Eigen::Vector2d &from);
} // namespace bole
