// SPDX-License-Identifier: GPL-2.0-or-later
// Taking in what is new: which variables it affects, eliminating those again, and passing the
// change down.
#include "state.h"

#include <algorithm>

namespace bole
{
namespace
{
constexpr int kRecentPoses = 64; ///< behind the newest, all of them keep their contribution
constexpr int kContributionEvery =
    8; ///< older poses that keep it; the rest is eliminated again if needed
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
  touched.clear();
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

/// From the roots down: all that was eliminated again, then whoever depends on a change worth
/// passing on.
void Smoother::State::backSubstitute(UpdateResult &result)
{
  ++change_stamp;
  const auto settle = [&](int id) {
    Variable &v = variables[id];
    solve(v);
    if (!v.delta.allFinite()) {
      v.delta.setZero();
      ++held_directions;
    }
    if (worthPassing(v)) {
      v.changed = change_stamp;
      v.passed = v.delta;
    }
    if (!v.in_moved && movedTooFar(v)) {
      v.in_moved = true;
      moved.push_back(id);
    }
    ++result.resolved;
  };
  stack.clear();
  for (auto id = affected.rbegin(); id != affected.rend(); ++id) {
    settle(*id);
    for (const int c : variables[*id].children)
      if (variables[c].affected != stamp)
        stack.push_back(c);
  }
  while (!stack.empty()) {
    const int id = stack.back();
    stack.pop_back();
    const Variable &v = variables[id];
    const bool depends = std::any_of(v.separator.begin(), v.separator.end(), [this](int s) {
      return variables[s].changed == change_stamp;
    });
    if (!depends)
      continue;
    settle(id);
    stack.insert(stack.end(), v.children.begin(), v.children.end());
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

UpdateResult Smoother::State::update()
{
  UpdateResult result;
  held_directions = 0;
  damping = 0;
  while (result.iterations < options.max_iterations) {
    for (const int id : moved) {
      Variable &v = variables[id];
      v.in_moved = false;
      if (v.life == Life::open && movedTooFar(v)) {
        relinearise(id);
        ++result.relinearised;
      }
    }
    moved.clear();
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
