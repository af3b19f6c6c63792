// SPDX-License-Identifier: GPL-2.0-or-later
// The optimum of the whole graph, by Levenberg-Marquardt over the same elimination.
#include "smoothing/state.h"

#include <algorithm>

namespace bole
{
/// Diagonal of the normal equations before elimination: the scale of Marquardt's damping.
void Smoother::State::measureDampingScale()
{
  damping_scale.assign(variables.size(), Vector6d::Constant(1e-9));
  const auto add = [this](int v, const double *columns, int rows) {
    for (int c = 0; c < variables[v].dim; ++c)
      for (int i = 0; i < rows; ++i)
        damping_scale[v](c) += columns[c * rows + i] * columns[c * rows + i];
  };
  for (const Factor &factor : factors) {
    if (!factor.alive || factor.kind == FactorKind::marginal)
      continue;
    const int rows = rowCount(factor.kind);
    add(factor.a, factor.linear.get(), rows);
    if (factor.b >= 0)
      add(factor.b, factor.linear.get() + rows * variables[factor.a].dim, rows);
  }
}

void Smoother::State::relineariseAll()
{
  for (int id = 0; id < static_cast<int>(variables.size()); ++id)
    if (isOpen(id))
      relinearise(id);
}

/// One solve of the whole graph with the present damping.
void Smoother::State::solveAll(UpdateResult &result)
{
  for (int id = 0; id < static_cast<int>(variables.size()); ++id) {
    if (!isOpen(id))
      continue;
    variables[id].in_moved = false;
    touch(id);
  }
  moved.clear();
  if (damping > 0) {
    for (const int id : stale_factors)
      if (factors[id].alive && factors[id].stale)
        linearise(factors[id]);
    measureDampingScale();
  }
  reeliminate(result);
  backSubstitute(result);
  ++result.iterations;
}

UpdateResult Smoother::State::optimize(double tolerance, int max_iterations)
{
  UpdateResult result;
  held_directions = 0;
  damping = 0;
  is_optimizing = true;
  double before = costAtEstimate();
  bool settled = false;
  relineariseAll();
  while (!settled && result.iterations < max_iterations) {
    solveAll(result);
    const double after = costAtEstimate(), fall = before - after;
    if (std::isfinite(after) && fall >= -1e-13 * std::abs(before)) {
      settled = fall <= tolerance * std::abs(before);
      before = after;
      relineariseAll();
      damping = damping < 1e-7 ? 0 : damping / 10;
    }
    else {
      for (Variable &v : variables)
        v.delta.setZero();
      settled = damping > 1e12 || (damping == 0 && fall >= -tolerance * std::max(1.0, std::abs(before))); // rounding
      damping = damping == 0 ? 1e-6 : damping * 10;
    }
  }
  damping = 0; // the factorisation left behind is that of the graph itself
  solveAll(result);
  is_optimizing = false;
  for (Variable &v : variables)
    if (v.eliminated)
      compressOld(v);
  const double after = costAtEstimate();
  if (!(after <= before))
    for (Variable &v : variables)
      v.delta.setZero();
  result.relinearised = variables.size();
  result.cost = std::min(before, std::isfinite(after) ? after : before);
  result.status = held_directions > 0 ? UpdateStatus::degenerate
                  : settled           ? UpdateStatus::ok
                                      : UpdateStatus::iteration_limit;
  if (options.fixed_lag > 0)
    marginaliseBehindLag();
  return result;
}
} // namespace bole
