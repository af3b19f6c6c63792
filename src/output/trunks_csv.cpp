// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/trunks_csv.h"
#include "input/csv_reader.h"
#include "output/atomic_file.h"

#include <fmt/format.h>
#include <iterator>

namespace bole
{
const char *const kTrunksCsvHeader = "id,x [m],y [m],radius [m],var_xx [m^2],var_xy [m^2],var_yy [m^2],"
                                     "var_radius [m^2],observations,first_seen [s],last_seen [s],status";

namespace
{
TrunkStatus readStatus(const CsvReader &csv, std::size_t column)
{
  for (const auto status : {TrunkStatus::candidate, TrunkStatus::confirmed, TrunkStatus::lost, TrunkStatus::merged})
    if (csv.text(column) == toString(status))
      return status;
  csv.fail(fmt::format("status = \"{}\", must be candidate, confirmed, lost or merged", csv.text(column)));
}
} // namespace

void writeTrunks(const std::string &path, const std::vector<TrunkRecord> &trunks)
{
  std::string text = fmt::format("{}\n", kTrunksCsvHeader);
  for (const TrunkRecord &trunk : trunks) {
    const Eigen::Matrix2d &P = trunk.covariance_xy;
    fmt::format_to(std::back_inserter(text),
                   "{},{:.6f},{:.6f},{:.6g},{:.6e},{:.6e},{:.6e},{:.6e},{},{:.9f},{:.9f},{}\n", trunk.id, trunk.xy.x(),
                   trunk.xy.y(), trunk.radius, P(0, 0), P(0, 1), P(1, 1), trunk.variance_radius, trunk.observations,
                   trunk.first_seen_s, trunk.last_seen_s, toString(trunk.status));
  }
  writeAtomically(path, text);
}

std::vector<TrunkRecord> readTrunks(const std::string &path)
{
  std::vector<TrunkRecord> trunks;
  CsvReader csv(path, {12, ',', kTrunksCsvHeader});
  while (csv.next()) {
    TrunkRecord trunk;
    trunk.id = static_cast<int>(csv.integer(0, "id"));
    trunk.xy = {csv.number(1, "x"), csv.number(2, "y")};
    trunk.radius = csv.number(3, "radius");
    if (!(trunk.radius > 0))
      csv.fail(fmt::format("radius = {}, must be above 0 m", trunk.radius));
    const double xx = csv.number(4, "var_xx"), xy = csv.number(5, "var_xy"), yy = csv.number(6, "var_yy");
    if (xx < 0 || yy < 0 || xx * yy - xy * xy < -1e-5 * (xx * yy))
      csv.fail("var_xx, var_xy, var_yy must be a covariance");
    trunk.covariance_xy << xx, xy, xy, yy;
    trunk.variance_radius = csv.number(7, "var_radius");
    trunk.observations = static_cast<int>(csv.integer(8, "observations"));
    trunk.first_seen_s = csv.number(9, "first_seen");
    trunk.last_seen_s = csv.number(10, "last_seen");
    trunk.status = readStatus(csv, 11);
    trunks.push_back(trunk);
  }
  return trunks;
}
} // namespace bole
