// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The map of trunks as a table.

#include <bole/trunk_record.h>

#include <string>
#include <vector>

namespace bole
{
/// Header of `trunks.csv`.
extern const char *const kTrunksCsvHeader;

/// Writes one line a trunk under kTrunksCsvHeader, atomically.
void writeTrunks(const std::string &path, const std::vector<TrunkRecord> &trunks);

/// Reads what writeTrunks() wrote. Errors: vpException with file:line.
std::vector<TrunkRecord> readTrunks(const std::string &path);
} // namespace bole
