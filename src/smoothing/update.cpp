// SPDX-License-Identifier: GPL-2.0-or-later
// Taking in what is new: which variables it affects, eliminating those again, and passing the
// change down.
#include "smoothing/state.h"

#include <algorithm>
#include <limits>

namespace bole
{
namespace
{
constexpr int kRecentPoses = 64;       ///< behind the newest; what is older keeps less
constexpr int kContributionEvery = 32; ///< older poses that keep it; the rest is eliminated again if needed
constexpr int kReach = 256;            ///< variables below the eliminated ones that a pass visits
constexpr int kVisits = 640;           ///< of variables in one update; a deeper pass goes on in the next ones
constexpr int kFetchNodes = 8, kFetchColumns = 3; ///< poses ahead of the one that is visited
constexpr unsigned kPassesBetween = 4;            ///< until one goes twice as deep
constexpr int kNearAge = 100;          ///< poses behind the newest: points that reach no farther may always move
constexpr unsigned kFartherEvery = 25; ///< passes until some may reach twice as far, and so on
constexpr int kQuiet = 16;             ///< variables in a row that are near their solution: the rest is left
} // namespace

void Smoother::State::touch(int variable) { touched.push_back(variable); }

/// Marks the affected variables: the touched ones and all their ancestors in the elimination tree.
void Smoother::State::markAncestors()
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
  markAncestors();
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
    for (const int child : variables[id].children) // its part is taken in
      compressOld(variables[child]);
  }
  result.eliminated += affected.size();
  freeDropped();
}

/// Asks for the memory of poses that a visit of \p pose will soon come to: over a long flight most
/// of its time is waiting for it.
void Smoother::State::fetchAhead(int pose) const
{
  const auto fetch = [](const void *from, std::size_t bytes) {
    for (std::size_t i = 0; i < bytes; i += 64)
      __builtin_prefetch(static_cast<const char *>(from) + i);
  };
  if (pose >= kFetchNodes && isOpen(poses[pose - kFetchNodes].variable))
    fetch(&variables[poses[pose - kFetchNodes].variable], sizeof(Variable));
  if (pose < kFetchColumns || !isOpen(poses[pose - kFetchColumns].variable))
    return;
  const Variable &v = variables[poses[pose - kFetchColumns].variable];
  fetch(v.columns.data(), v.columns.size() * sizeof(double));
  fetch(v.old_columns.data(), v.old_columns.size() * sizeof(float));
  fetch(v.separator.data(), v.separator.size() * sizeof(int));
  fetch(v.children.data(), v.children.size() * sizeof(int));
}

/// Visits what is \p open and what is below it, as long as \p visits remain, and settles whatever stands too far from
/// its solution given those above it.
void Smoother::State::visitBelow(std::vector<Descent> &open, int &visits, UpdateResult &result)
{
  double rhs[6];
  for (; !open.empty() && visits > 0; --visits) {
    const auto [id, below, quiet] = open.back();
    open.pop_back();
    Variable &v = variables[id];
    if (!isOpen(id) || v.affected == stamp) // since it was put there
      continue;
    if (v.is_pose)
      fetchAhead(v.number);
    v.visited = passes;
    const bool stale = staleness(v, rhs) > options.propagation_threshold;
    if (stale)
      resolveIfStale(v, id, rhs, result);
    const int still = stale ? 0 : quiet + 1;
    if (still < kQuiet && below > 0)
      pushChildren(open, id, below - 1, still);
  }
}

void Smoother::State::pushChildren(std::vector<Descent> &open, int id, int below, int quiet) const
{
  for (const int c : variables[id].children)
    if (variables[c].affected != stamp)
      open.push_back({c, below, quiet});
}

void Smoother::State::resolveIfStale(Variable &v, int id, double *rhs, UpdateResult &result)
{
  solve(v, rhs);
  if (!v.delta.allFinite()) {
    v.delta.setZero();
    ++held_directions;
  }
  if (!v.in_moved) {
    v.in_moved = true;
    moved.push_back(id);
  }
  ++result.resolved;
}

/// How deep below what was eliminated again this pass goes. Every kPassesBetween-th pass goes twice as deep, of those
/// again every kPassesBetween-th, and so on: variables far back are brought up to date too, but less often.
int Smoother::State::passDepth()
{
  if (options.propagation_threshold == 0)
    return std::numeric_limits<int>::max();
  int depth = kReach;
  for (unsigned pass = passes; pass % kPassesBetween == 0 && depth < 1 << 28; pass /= kPassesBetween)
    depth *= 2;
  return depth;
}

/// From the roots down: all that was eliminated again, then some way below it. A deep pass is spread over as many
/// updates as it takes at kVisits each, after what each of them has to do itself: a variable that is settled later is
/// so by the estimates above it then.
void Smoother::State::backSubstitute(UpdateResult &result)
{
  double rhs[6];
  ++passes;
  const int below = passDepth();
  for (auto id = affected.rbegin(); id != affected.rend(); ++id) {
    variables[*id].visited = passes;
    staleness(variables[*id], rhs);
    resolveIfStale(variables[*id], *id, rhs, result);
    pushChildren(descents, *id, below - 1, 0);
  }
  int visits = options.propagation_threshold == 0 ? std::numeric_limits<int>::max() : kVisits;
  visitBelow(descents, visits, result);
  visitBelow(postponed, visits, result);
  postponed.insert(postponed.end(), descents.begin(), descents.end());
  descents.clear();
  const auto isFine = [this](int id) {
    variables[id].in_moved = variables[id].in_moved && needsRelinearisation(variables[id]);
    return !variables[id].in_moved;
  };
  moved.erase(std::remove_if(moved.begin(), moved.end(), isFine), moved.end());
}

/// Frees what an old variable left to its parent, but for every kContributionEvery-th pose: where it is needed, the
/// variable is eliminated again. The blocks of its factors are freed as well (they are linearised again at the same
/// points), and its columns rounded: an error of 6e-8 of their entries, which are inverse standard deviations. A delta
/// of a metre beside a standard deviation of .1 mm is off by 1e-3 of the latter.
void Smoother::State::compressOld(Variable &v)
{
  if (options.fixed_lag > 0) // bounds the memory by itself, and closes a pose by its contribution
    return;
  const int oldest_recent = static_cast<int>(poses.size()) - kRecentPoses;
  if ((v.is_pose ? v.number : trunks[v.number].last_pose) >= oldest_recent)
    return;
  if (!v.is_pose || v.number % kContributionEvery != 0) {
    v.has_contribution = false;
    std::vector<double>().swap(v.contribution);
  }
  if (is_optimizing || options.propagation_threshold == 0 || v.columns.empty())
    return;
  for (const int id : v.assembled)
    if (factors[id].alive)
      factors[id].linear.reset();
  v.old_columns.assign(v.columns.begin(), v.columns.end());
  std::vector<double>().swap(v.columns);
}

/// How far the points are shifted against the estimates just beyond what is eliminated again.
Eigen::Vector3d Smoother::State::shiftBeyondAffected() const
{
  int seam = static_cast<int>(poses.size()) - 1;
  while (seam >= 0 && isOpen(poses[seam].variable) && variables[poses[seam].variable].affected == stamp)
    --seam;
  return seam < 0 ? Eigen::Vector3d::Zero() : shiftOfPoint(seam);
}

/// How many poses behind the newest this pass may move points of linearisation.
int Smoother::State::movableAge() const
{
  if (options.propagation_threshold == 0)
    return std::numeric_limits<int>::max();
  int age = kNearAge;
  for (unsigned every = kFartherEvery; passes % every == 0 && age < 1 << 28; every *= 2)
    age *= 2;
  return age;
}

/// How many poses behind the newest those stand that are eliminated again when \p variable is linearised again. What
/// marginalised variables have left lies at the far end of all that is open.
int Smoother::State::reachBack(const Variable &variable) const
{
  const int newest = static_cast<int>(poses.size()) - 1;
  int oldest = variable.is_pose ? variable.number : trunks[variable.number].last_pose;
  int reach = 0;
  for (const int f : variable.factors) {
    if (factors[f].kind == FactorKind::observation)
      oldest = std::min(oldest, variables[factors[f].a].number);
    if (factors[f].kind == FactorKind::marginal)
      reach = std::max(newest - oldest_open_pose, kNearAge + 1);
  }
  return std::max(reach, newest - oldest);
}

/// Relinearises the variables that moved too far, and those that are eliminated again in any case. Linearisation points
/// must be consistent: a factor between a relinearised variable and one whose estimate has left its own point, even by
/// a shift common to both, has wrong lever arms; its other variable then moves too far as well, and so on along the
/// whole flight. So the new points are the estimates, all shifted by the offset between estimate and point of the first
/// variable that is not relinearised. Positions are then consistent on both sides, and a common shift is exactly linear
/// in all measurements.
///
/// An old variable, or a trunk that was seen long ago, needs all later ones to be eliminated again. So the older it is,
/// the less often it is relinearised; a later pass finds those that have to wait.
void Smoother::State::moveLinearisation(UpdateResult &result)
{
  const int age = movableAge();
  const auto mayMove = [&](const Variable &v) { return reachBack(v) <= age; };
  const auto move = [&](int id) {
    variables[id].in_moved = true;
    touchNeighbours(id);
  };
  bool any = false;
  for (const int id : moved) {
    Variable &v = variables[id];
    v.in_moved = false;
    if (v.life != Life::open || !mayMove(v))
      continue;
    any = true;
    move(id);
    for (const int f : v.factors) // what is between two is not put right by moving one
      if (v.is_pose && factors[f].kind == FactorKind::observation &&
          linearisationError(factors[f]) > options.linearisation_tolerance && mayMove(variables[factors[f].b]))
        move(factors[f].b);
  }
  moved.clear();
  if (!any)
    return;
  markAncestors();
  const Eigen::Vector3d shift = shiftBeyondAffected();
  for (const int id : affected) {
    if (variables[id].in_moved || isInside(variables[id])) {
      relinearise(id, shift);
      ++result.relinearised;
    }
    variables[id].in_moved = false;
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
    if (const int old = static_cast<int>(poses.size()) - 1 - kRecentPoses; old >= 0 && isOpen(poses[old].variable))
      for (const int child : variables[poses[old].variable].children)
        compressOld(variables[child]);
    ++result.iterations;
  }
  if (options.fixed_lag > 0)
    marginaliseBehindLag();
  result.cost = constant_cost;
  if (!moved.empty())
    result.status = UpdateStatus::iteration_limit;
  if (held_directions > 0)
    result.status = UpdateStatus::degenerate;
  return result;
}
} // namespace bole
