// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/trunks_csv.h"
#include "input/atomic_file.h"
#include "input/csv_reader.h"

#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <iterator>

namespace bole
{
const char *const kTrunksCsvHeader =
    "id,status,x,y,radius,lean_x,lean_y,ground_z,probability,first_seen,last_seen,views,var_xx,var_xy,var_yy,"
    "var_radius,var_lean_xx,var_lean_xy,var_lean_yy,cov_x_radius,cov_y_radius,cov_x_lean_x,cov_x_lean_y,cov_y_lean_x,"
    "cov_y_lean_y,cov_radius_lean_x,cov_radius_lean_y";

namespace
{
const char *const kUnits = "# units,,m,m,m,1,1,m,1,s,s,1,m^2,m^2,m^2,m^2,1,1,1,m^2,m^2,m,m,m,m,m,m";
const char *const kFateColumn = ",fate";

/// The header names the entries of TrunkRecord::covariance from column 12 on, in these rows and columns of the matrix.
constexpr std::size_t kFirstCovariance = 12, kColumns = 27;
constexpr std::array<int, 15> kRowOf = {0, 0, 1, 2, 3, 3, 4, 0, 1, 0, 0, 1, 1, 2, 2};
constexpr std::array<int, 15> kColumnOf = {0, 1, 1, 2, 3, 4, 4, 2, 2, 3, 4, 3, 4, 3, 4};

void addRow(std::string &text, const TrunkRecord &trunk)
{
  fmt::format_to(std::back_inserter(text), "{},{},{:.6f},{:.6f},{:.6g},{:.6f},{:.6f},{:.4f},{:.6f},{:.9f},{:.9f},{}",
                 trunk.id, toString(trunk.status), trunk.xy.x(), trunk.xy.y(), trunk.radius, trunk.lean.x(),
                 trunk.lean.y(), trunk.ground_z, trunk.probability, trunk.first_seen_s, trunk.last_seen_s,
                 trunk.observations);
  for (std::size_t i = 0; i < kRowOf.size(); ++i)
    fmt::format_to(std::back_inserter(text), ",{:.6e}", trunk.covariance(kRowOf[i], kColumnOf[i]));
}

TrunkRecord readRow(const CsvReader &csv)
{
  TrunkRecord trunk;
  trunk.id = csv.count(0, "id");
  trunk.status = csv.named(1, "status", TrunkStatus::merged, "must be candidate, confirmed, lost or merged");
  constexpr double kFarthest_m = 1e6, kThickest_m = 100;
  trunk.xy = {csv.number(2, "x", kFarthest_m), csv.number(3, "y", kFarthest_m)};
  trunk.radius = csv.number(4, "radius", kThickest_m);
  if (!(trunk.radius > 0))
    csv.fail(fmt::format("radius = {}, must be above 0 m", trunk.radius));
  trunk.lean = {csv.number(5, "lean_x"), csv.number(6, "lean_y")};
  trunk.ground_z = csv.number(7, "ground_z");
  trunk.probability = csv.number(8, "probability");
  trunk.first_seen_s = csv.number(9, "first_seen");
  trunk.last_seen_s = csv.number(10, "last_seen");
  trunk.observations = csv.count(11, "views");
  for (std::size_t i = 0; i < kRowOf.size(); ++i) {
    const int row = kRowOf[i], column = kColumnOf[i];
    trunk.covariance(row, column) = trunk.covariance(column, row) = csv.number(kFirstCovariance + i, "covariance");
  }
  const Eigen::Matrix2d P = trunk.covarianceXy();
  if (P(0, 0) < 0 || P(1, 1) < 0 || P.determinant() < -1e-5 * (P(0, 0) * P(1, 1)))
    csv.fail("var_xx, var_xy, var_yy must be a covariance");
  return trunk;
}
} // namespace

void writeTrunks(const std::string &path, const std::vector<TrunkRecord> &map)
{
  std::string text = fmt::format("{}\n{}\n", kTrunksCsvHeader, kUnits);
  for (const TrunkRecord &trunk : map) {
    if (trunk.status != TrunkStatus::confirmed)
      continue;
    addRow(text, trunk);
    text += '\n';
  }
  writeAtomically(path, text);
}

void writeHypotheses(const std::string &path, const std::vector<TrunkRecord> &map)
{
  std::string text = fmt::format("{}{}\n{},\n", kTrunksCsvHeader, kFateColumn, kUnits);
  for (const TrunkRecord &trunk : map) {
    if (trunk.status == TrunkStatus::confirmed)
      continue;
    addRow(text, trunk);
    fmt::format_to(std::back_inserter(text), ",{}\n", toString(trunk.reject_reason));
  }
  writeAtomically(path, text);
}

std::vector<TrunkRecord> readTrunks(const std::string &path)
{
  CsvReader csv(path, {kColumns, ',', kTrunksCsvHeader});
  const bool has_fate = csv.header().size() > kColumns;
  std::vector<TrunkRecord> trunks;
  while (csv.next()) {
    trunks.push_back(readRow(csv));
    if (has_fate)
      trunks.back().reject_reason = csv.named(kColumns, "fate", RejectReason::unranged);
  }
  return trunks;
}

void writeBearings(const std::string &path, const std::vector<TrunkRecord> &map, const Eigen::Vector2d &from)
{
  constexpr double kDegrees = 180 / M_PI;
  std::string text =
      "id,status,bearing,width,sigma_bearing,sigma_width,views\n# units,,degrees,degrees,degrees,degrees,1\n";
  for (const TrunkRecord &trunk : map) {
    const Eigen::Vector2d to = trunk.xy - from;
    const double range = to.norm(), ratio = std::min(0.99, trunk.radius / range);
    if (trunk.status != TrunkStatus::confirmed || !(range > 0))
      continue;
    const Eigen::Vector2d across = Eigen::Vector2d(-to.y(), to.x()) / range, along = to / range;
    const double across_sigma = std::sqrt(std::max(0.0, across.dot(trunk.covarianceXy() * across)));
    // An image tells the ratio r/d far better than r and d, whose errors go together.
    Eigen::Vector3d J(-along.x() * ratio / range, -along.y() * ratio / range, 1 / range);
    const double ratio_variance = J.dot(trunk.covariance.topLeftCorner<3, 3>() * J);
    fmt::format_to(std::back_inserter(text), "{},{},{:.4f},{:.4f},{:.4f},{:.4f},{}\n", trunk.id, toString(trunk.status),
                   std::atan2(to.y(), to.x()) * kDegrees, 2 * std::asin(ratio) * kDegrees,
                   across_sigma / range * kDegrees,
                   2 * std::sqrt(std::max(0.0, ratio_variance) / (1 - ratio * ratio)) * kDegrees, trunk.observations);
  }
  writeAtomically(path, text);
}
} // namespace bole
