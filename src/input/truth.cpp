// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/csv_reader.h"
#include <bole/open_source.h>

#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <set>

namespace bole
{
namespace
{
void readTrees(const std::string &path, bool is_far, std::set<int> &ids, std::vector<TruthTrunk> &trunks)
{
  CsvReader csv(path, is_far ? CsvFormat{3, ',', "id,x [m],y [m]"}
                             : CsvFormat{5, ',', "id,x [m],y [m],radius [m],lean [deg]"});
  while (csv.next()) {
    TruthTrunk trunk;
    trunk.id = static_cast<int>(csv.integer(0, "id"));
    if (!ids.insert(trunk.id).second)
      csv.fail(fmt::format("id = {}, must not come twice", trunk.id));
    trunk.xy = {csv.number(1, "x"), csv.number(2, "y")};
    if (!is_far) {
      trunk.radius = csv.number(3, "radius");
      trunk.lean = csv.number(4, "lean") * M_PI / 180;
      if (!(trunk.radius > 0))
        csv.fail(fmt::format("radius = {}, must be above 0 m", trunk.radius));
    }
    trunks.push_back(trunk);
  }
}
} // namespace

std::vector<TruthTrunk> readTruthTrunks(const std::string &sequence)
{
  const std::filesystem::path folder(sequence);
  std::vector<TruthTrunk> trunks;
  std::set<int> ids;
  if (!std::filesystem::exists(folder / "trees.csv"))
    return trunks;
  readTrees((folder / "trees.csv").string(), false, ids, trunks);
  if (std::filesystem::exists(folder / "trees_far.csv"))
    readTrees((folder / "trees_far.csv").string(), true, ids, trunks);
  return trunks;
}
} // namespace bole
