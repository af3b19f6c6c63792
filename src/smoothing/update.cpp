// SPDX-License-Identifier: GPL-2.0-or-later
// Taking in what is new: which variables it affects, eliminating those again, and passing the
// change down.
#include "state.h"

#include <algorithm>
#include <limits>

namespace bole
{
namespace
{
constexpr int kRecentPoses = 64; ///< behind the newest, all of them keep their contribution
constexpr int kContributionEvery =
    8;                      ///< older poses that keep it; the rest is eliminated again if needed
constexpr int kReach = 256; ///< variables below the eliminated ones that a pass visits
constexpr unsigned kPassesBetween = 4; ///< until one goes twice as deep
constexpr unsigned kDeepEvery = 512;   ///< passes until one may move points of any age
constexpr int kDeepAge = 400;          ///< poses behind the newest: older points are left meanwhile
constexpr int kQuietPoints = 4; ///< variables in a row near their point: the rest keeps its points
constexpr double kWorthAligning = 0.1; ///< thresholds of relinearisation
constexpr int kQuiet = 16; ///< variables in a row that are near their solution: the rest is left
} // namespace

void Smoother::State::touch(int variable) { touched.push_back(variable); }

/// The affected variables: all on the paths from the touched ones to their roots.
void Smoother::State::closeUpwards()
{
  ++stamp;
  affected.clear();
  for (const int start : touched)
    for (int v = start; v >= 0 && variables[v].affected != stamp; v = variables[v].parent) {
      variables[v].affected = stamp;
      if (isOpen(v))
        affected.push_back(v);
    }
}

/// A child that is not affected enters through its contribution; where that was dropped to save
/// memory, the child is eliminated again, too.
void Smoother::State::addMissingContributions()
{
  for (std::size_t i = 0; i < affected.size(); ++i)
    for (const int c : variables[affected[i]].children)
      if (variables[c].affected != stamp && !variables[c].has_contribution) {
        variables[c].affected = stamp;
        affected.push_back(c);
      }
}

void Smoother::State::reeliminate(UpdateResult &result)
{
  for (const int id : stale_factors) {
    Factor &factor = factors[id];
    if (factor.alive && factor.stale)
      linearise(factor);
  }
  closeUpwards();
  touched.clear();
  addMissingContributions();
  orderAffected();

  // Release what the affected variables held, then deal it out again by the new order.
  pool.clear();
  for (const int id : stale_factors)
    if (factors[id].alive && factors[id].assembled_at < 0)
      pool.push_back(id);
  stale_factors.clear();
  orphans.clear();
  for (const int id : affected) {
    Variable &v = variables[id];
    constant_cost -= v.share;
    for (const int f : v.assembled)
      if (factors[f].alive)
        pool.push_back(f);
    for (const int c : v.children)
      if (variables[c].affected != stamp && isOpen(c))
        orphans.push_back(c);
    v.assembled.clear();
    v.children.clear();
    v.order = next_order++;
  }
  const auto earlier = [this](int l, int r) { return variables[l].order < variables[r].order; };
  for (const int f : pool) {
    Factor &factor = factors[f];
    int first = factor.a;
    if (factor.kind == FactorKind::marginal) {
      const std::vector<int> &list = marginals[factor.data].variables;
      first = *std::min_element(list.begin(), list.end(), earlier);
    }
    else if (factor.b >= 0 && earlier(factor.b, first)) {
      first = factor.b;
    }
    factor.assembled_at = first;
    variables[first].assembled.push_back(f);
  }
  for (const int c : orphans) {
    const std::vector<int> &list = variables[c].separator;
    const int parent = *std::min_element(list.begin(), list.end(), earlier);
    variables[c].parent = parent;
    variables[parent].children.push_back(c);
  }
  for (const int id : affected) {
    eliminate(id);
    constant_cost += variables[id].share;
  }
  result.eliminated += affected.size();
}

/// How deep below what was eliminated again this pass goes: now and then twice as far as the passes
/// between, and so on, so that what lies far back is brought up to date, less often the farther.
int Smoother::State::reach()
{
  if (options.propagation_threshold == 0)
    return std::numeric_limits<int>::max();
  int depth = kReach;
  for (unsigned pass = ++passes; pass % kPassesBetween == 0 && depth < 1 << 28;
       pass /= kPassesBetween)
    depth *= 2;
  return depth;
}

/// From the roots down: all that was eliminated again, then whatever stands too far from its
/// solution given those above it.
void Smoother::State::backSubstitute(UpdateResult &result)
{
  double rhs[6];
  const auto settle = [&](int id) {
    Variable &v = variables[id];
    solve(v, rhs);
    if (!v.delta.allFinite()) {
      v.delta.setZero();
      ++held_directions;
    }
    if (!v.in_moved && movedTooFar(v)) {
      v.in_moved = true;
      moved.push_back(id);
    }
    ++result.resolved;
  };
  stack.clear();
  const auto descend = [&](int id, int depth, int quiet) {
    for (const int c : variables[id].children)
      if (variables[c].affected != stamp)
        stack.push_back({c, depth, quiet});
  };
  for (auto id = affected.rbegin(); id != affected.rend(); ++id) {
    staleness(variables[*id], rhs);
    settle(*id);
    descend(*id, 1, 0);
  }
  const int deepest = reach();
  while (!stack.empty()) {
    const auto [id, depth, quiet] = stack.back();
    stack.pop_back();
    const bool stale = staleness(variables[id], rhs) > options.propagation_threshold;
    if (stale)
      settle(id);
    const int still = stale ? 0 : quiet + 1;
    if (still < kQuiet && depth < deepest)
      descend(id, depth + 1, still);
  }
}

void Smoother::State::dropOldContributions()
{
  const int newest = static_cast<int>(poses.size()) - 1;
  const auto drop = [&](int number) {
    Variable &v = variables[poses[number].variable];
    if (!v.has_contribution || number % kContributionEvery == 0)
      return;
    v.has_contribution = false;
    std::vector<double>().swap(v.contribution);
  };
  if (newest - kRecentPoses >= 0)
    drop(newest - kRecentPoses);
  for (const int id : affected)
    if (variables[id].is_pose && variables[id].number < newest - kRecentPoses)
      drop(variables[id].number);
}

/// Linearises anew what moved too far. Points must fit together: where a relinearised variable
/// meets one whose estimate has left its point, by however common a shift, the lever arms between
/// them are wrong, the next one down moves too far in its turn, and so on down the whole flight. So
/// everything between, which is eliminated again anyway, is relinearised too, and all below that
/// has moved along.
///
/// Moving old points eliminates all since again: seldom, and what was found in between is found
/// once more by the deep pass before.
void Smoother::State::moveLinearisation(UpdateResult &result)
{
  const bool deep = options.propagation_threshold == 0 || passes % kDeepEvery == 0;
  const int newest = static_cast<int>(poses.size()) - 1;
  const auto mayMove = [&](const Variable &v) {
    return deep || newest - (v.is_pose ? v.number : trunks[v.number].last_pose) <= kDeepAge;
  };
  bool any = false;
  for (const int id : moved) {
    Variable &v = variables[id];
    v.in_moved = false;
    if (v.life == Life::open && mayMove(v) && movedTooFar(v)) {
      relinearise(id);
      ++result.relinearised;
      any = true;
    }
  }
  moved.clear();
  if (!any)
    return;
  closeUpwards();
  stack.clear();
  const auto descend = [&](int id, int quiet) {
    for (const int c : variables[id].children)
      if (variables[c].affected != stamp && isOpen(c))
        stack.push_back({c, 0, quiet});
  };
  for (const int id : affected)
    descend(id, 0);
  while (!stack.empty()) {
    const auto [id, depth, quiet] = stack.back();
    stack.pop_back();
    const bool along =
        mayMove(variables[id]) && inThresholds(variables[id], variables[id].delta) > 1;
    if (along) {
      relinearise(id);
      ++result.relinearised;
    }
    if (along || quiet + 1 < kQuietPoints)
      descend(id, along ? 0 : quiet + 1);
  }
  closeUpwards();
  for (const int id : affected) {
    const Variable &v = variables[id];
    if (inThresholds(v, v.delta) > kWorthAligning && isInside(v)) {
      relinearise(id);
      ++result.relinearised;
    }
  }
}

UpdateResult Smoother::State::update()
{
  UpdateResult result;
  held_directions = 0;
  damping = 0;
  while (result.iterations < options.max_iterations) {
    moveLinearisation(result);
    if (touched.empty())
      break;
    reeliminate(result);
    backSubstitute(result);
    dropOldContributions();
    ++result.iterations;
  }
  if (options.fixed_lag > 0)
    closeBehindLag();
  result.cost = constant_cost;
  if (!moved.empty())
    result.status = UpdateStatus::iteration_limit;
  if (held_directions > 0)
    result.status = UpdateStatus::degenerate;
  return result;
}
} // namespace bole
