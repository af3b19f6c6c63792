// SPDX-License-Identifier: GPL-2.0-or-later
#include "evaluation/trunk_metrics.h"

#include <limits>

namespace bole
{
namespace
{
/// Least-cost assignment of every row of \p cost, rows <= columns, by shortest augmenting paths.
std::vector<int> assignRows(const Eigen::MatrixXd &cost)
{
  const Eigen::Index rows = cost.rows(), columns = cost.cols();
  const Eigen::Index none = columns; // a column that does not exist: where each search starts
  Eigen::VectorXd row_price = Eigen::VectorXd::Zero(rows), column_price = Eigen::VectorXd::Zero(columns + 1);
  std::vector<Eigen::Index> row_of(static_cast<std::size_t>(columns) + 1, -1);
  for (Eigen::Index row = 0; row < rows; ++row) {
    Eigen::VectorXd slack = Eigen::VectorXd::Constant(columns, std::numeric_limits<double>::infinity());
    std::vector<Eigen::Index> came_from(static_cast<std::size_t>(columns), none);
    std::vector<bool> is_done(static_cast<std::size_t>(columns) + 1, false);
    Eigen::Index at = none;
    row_of[static_cast<std::size_t>(none)] = row;
    while (row_of[static_cast<std::size_t>(at)] >= 0) {
      is_done[static_cast<std::size_t>(at)] = true;
      const Eigen::Index r = row_of[static_cast<std::size_t>(at)];
      double least = std::numeric_limits<double>::infinity();
      Eigen::Index nearest = none;
      for (Eigen::Index c = 0; c < columns; ++c) {
        if (is_done[static_cast<std::size_t>(c)])
          continue;
        const double reduced = cost(r, c) - row_price[r] - column_price[c];
        if (reduced < slack[c]) {
          slack[c] = reduced;
          came_from[static_cast<std::size_t>(c)] = at;
        }
        if (slack[c] < least) {
          least = slack[c];
          nearest = c;
        }
      }
      for (Eigen::Index c = 0; c <= columns; ++c)
        if (is_done[static_cast<std::size_t>(c)]) {
          row_price[row_of[static_cast<std::size_t>(c)]] += least;
          column_price[c] -= least;
        }
        else if (c < columns)
          slack[c] -= least;
      at = nearest;
    }
    while (at != none) {
      const Eigen::Index before = came_from[static_cast<std::size_t>(at)];
      row_of[static_cast<std::size_t>(at)] = row_of[static_cast<std::size_t>(before)];
      at = before;
    }
  }
  std::vector<int> column_of(static_cast<std::size_t>(rows), -1);
  for (Eigen::Index c = 0; c < columns; ++c)
    if (row_of[static_cast<std::size_t>(c)] >= 0)
      column_of[static_cast<std::size_t>(row_of[static_cast<std::size_t>(c)])] = static_cast<int>(c);
  return column_of;
}
} // namespace

std::vector<int> assign(const Eigen::MatrixXd &cost, double gate)
{
  if (cost.rows() == 0 || cost.cols() == 0)
    return std::vector<int>(static_cast<std::size_t>(cost.rows()), -1);
  // A pair beyond the gate costs more than all pairs within it together, so it is never preferred;
  // spare columns let every row stay alone at that price.
  const double alone = (gate + 1) * static_cast<double>(cost.rows() + 1);
  Eigen::MatrixXd padded = Eigen::MatrixXd::Constant(cost.rows(), cost.cols() + cost.rows(), alone);
  padded.leftCols(cost.cols()) = (cost.array() <= gate).select(cost.array(), 4 * alone).matrix();
  std::vector<int> column_of = assignRows(padded);
  for (int &column : column_of)
    if (column >= cost.cols())
      column = -1;
  return column_of;
}
} // namespace bole
