// SPDX-License-Identifier: GPL-2.0-or-later
// In flight: the poses of the window and the trunks that it sees, with a prior for all that left it.
#include "geometry/failure.h"
#include "smoothing/state.h"

#include <algorithm>

namespace bole
{
void Places::take(const Name &name)
{
  std::vector<int> &list = name.is_pose ? pose : trunk;
  const std::size_t number = name.is_pose ? name.number - first_pose : name.number;
  list.resize(std::max(list.size(), number + 1), -1);
  int &at = list[number];
  if (at >= 0)
    return;
  at = static_cast<int>(names.size());
  names.push_back(name);
  dims.push_back(name.is_pose ? 6 : 5);
}

/// Poses come first: then each block of the normal equations is found in the short list of a pose.
void Smoother::State::placeWindow()
{
  window_places = Places();
  window_places.first_pose = first_open;
  for (std::size_t i = first_open; i < poses.size(); ++i)
    window_places.take({true, i});
  for (const Name &name : prior.names)
    window_places.take(name);
  for (std::size_t j = 0; j < trunks.size(); ++j)
    if (isInWindow(trunks[j]))
      window_places.take({false, j});
  if (window)
    window->reset(window_places.dims);
  else
    window.emplace(window_places.dims);
}

double Smoother::State::addWindow(NormalEquations *system) const
{
  double cost = addWindowPrior(window_places, system);
  for (std::size_t i = first_open; i < poses.size(); ++i)
    cost += add(i, window_places, system);
  for (const Name &name : window_places.names)
    if (!name.is_pose)
      cost += addTrunkPrior(name.number, window_places, system);
  return cost;
}

/// Linearises and eliminates: first the trunks that only the prior knows, then the poses as they were flown, and in one
/// piece what the next frame asks for, the trunks in sight and the newest pose. Returns the cost before the step.
double Smoother::State::solveWindow(UpdateResult &result)
{
  window->clear();
  const double cost = addWindow(&*window);
  if (result.iterations == 0) {
    std::vector<int> order, last;
    for (const Name &name : window_places.names)
      if (!name.is_pose)
        (isInWindow(trunks[name.number]) ? last : order).push_back(window_places.of(name));
    for (std::size_t i = first_open; i < poses.size(); ++i)
      (i + 1 < poses.size() ? order : last).push_back(window_places.of({true, i}));
    const int together = static_cast<int>(last.size());
    order.insert(order.end(), last.begin(), last.end());
    window->plan(order, together);
  }
  if (window->factorise() > 0)
    result.status = UpdateStatus::degenerate;
  return cost;
}

UpdateResult Smoother::State::update()
{
  constexpr double kSettled = 5e-3; // of the cost: a tenth of a standard deviation
  UpdateResult result;
  if (poses.empty())
    return result;
  if (is_whole_due && !options.forgets) {
    constexpr double kNear = 1e-4; // of the cost: the window goes on from there
    constexpr int kMost = 5;
    solveWhole(kNear, kMost, false);
  }
  is_whole_due = false;
  shrink();
  placeWindow();
  bool is_settled = false;
  while (!is_settled && result.iterations < options.max_iterations) {
    const double before = solveWindow(result), decrease = window->decrease();
    move(window_places, *window);
    is_settled = decrease < kSettled;
    result.cost = before - decrease;
    ++result.iterations;
  }
  if (result.status == UpdateStatus::ok && !is_settled)
    result.status = UpdateStatus::iteration_limit;
  return result;
}

/// Which trunks are not taken out of the prior when the window begins at \p until: those in sight, and of the others
/// those seen last, for they may come back.
std::vector<bool> Smoother::State::remembered(std::size_t until) const
{
  std::vector<bool> stays(trunks.size(), false);
  std::vector<std::size_t> others;
  for (std::size_t j = 0; j < trunks.size(); ++j) {
    const TrunkState &trunk = trunks[j];
    if (trunk.is_removed || !trunk.is_kept)
      stays[j] = !trunk.is_removed && trunk.point && !trunk.seen.empty() && trunk.seen.back() >= until;
    else if (!trunk.seen.empty() && trunk.seen.back() >= until)
      stays[j] = true;
    else if (trunk.point || (!trunk.is_absorbed && !trunk.seen.empty()))
      others.push_back(j);
  }
  std::stable_sort(others.begin(), others.end(),
                   [this](std::size_t a, std::size_t b) { return trunks[a].last_seen > trunks[b].last_seen; });
  for (std::size_t k = 0; k < std::min(others.size(), static_cast<std::size_t>(options.remembered)); ++k)
    stays[others[k]] = true;
  return stays;
}

/// By how much all that the prior touches was shifted since it was linearised: what leaves, by the trunks in sight, the
/// least error in the bearings from the newest pose at which they are linearised; where none is in sight, by the newest
/// pose of the prior. That pose alone is no measure: each has moved by an error of its own while it was the newest, and
/// these add up.
Eigen::Vector3d Smoother::State::shiftOfPrior() const
{
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  for (const Name &name : prior.names)
    if (name.is_pose)
      shift = poses[name.number].t - pointOf(name.number).t;
  constexpr double kNearest = 0.5; // m: the camera is beside no axis
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double weights = 0;
  for (const Name &name : prior.names)
    if (!name.is_pose && isInWindow(trunks[name.number])) {
      const TrunkState &trunk = trunks[name.number];
      const double range = std::max(kNearest, (trunk.value.xy - poses.back().t.head<2>()).norm());
      sum += (trunk.value.xy - trunk.point->xy) / (range * range);
      weights += 1 / (range * range);
    }
  if (weights > 0)
    shift.head<2>() = sum / weights;
  return shift;
}

/// The points of the prior follow where all of it was shifted to, or new poses would be linearised with trunks that
/// stand elsewhere. The quadratic stays what it is.
void Smoother::State::recentre()
{
  const Eigen::Vector3d shift = shiftOfPrior();
  Eigen::VectorXd moved = Eigen::VectorXd::Zero(prior.g.size());
  int row = 0;
  for (const Name &name : prior.names) {
    if (name.is_pose) {
      Pose &point = *points[name.number - first_open];
      moved.segment<3>(row) = point.R.transpose() * shift;
      point.t += shift;
      row += 6;
    }
    else {
      Trunk &point = *trunks[name.number].point;
      moved.segment<2>(row) = shift.head<2>() - shift.z() * point.lean;
      point.xy += moved.segment<2>(row);
      row += 5;
    }
  }
  prior.g -= prior.H * moved;
}

/// Takes the factors of the poses [from, until) into the prior, which then is one on what stays alone. Each factor is
/// counted once, but for the views of trunks that are not kept: these are left out.
void Smoother::State::absorb(std::size_t from, std::size_t until)
{
  if (from == until)
    return;
  Places places;
  places.first_pose = from;
  for (std::size_t i = from; i < until; ++i) {
    places.take({true, i});
    for (const StepFactor &factor : factorsOf(i).steps)
      places.take({true, std::max(factor.a, factor.b)});
    for (const DirectionFactor &factor : factorsOf(i).directions)
      places.take({true, std::max(factor.a, factor.b)});
  }
  for (const Name &name : prior.names)
    places.take(name);
  for (std::size_t i = from; i < until; ++i)
    for (const ViewFactor &factor : factorsOf(i).views)
      if (trunks[factor.trunk].is_kept)
        places.take({false, factor.trunk});
  NormalEquations system(places.dims);
  addWindowPrior(places, &system, true);
  for (std::size_t i = from; i < until; ++i)
    add(i, places, &system, true, true);
  const std::vector<bool> is_remembered = remembered(until);
  const auto stays = [&](int variable) {
    const Name &name = places.names[variable];
    return name.is_pose ? name.number >= until : is_remembered[name.number];
  };
  for (int v = 0; v < static_cast<int>(places.names.size()); ++v)
    if (!places.names[v].is_pose && !stays(v))
      addTrunkPrior(places.names[v].number, places, &system, true);
  std::vector<int> order = system.orderOfLittleFill();
  const auto staying = std::stable_partition(order.begin(), order.end(), [&](int v) { return !stays(v); });
  system.plan(order, static_cast<int>(order.end() - staying));
  prior = WindowPrior();
  if (staying != order.end())
    system.schur(prior.H, prior.g);
  for (auto v = order.begin(); v != order.end(); ++v) {
    const Name &name = places.names[*v];
    if (v >= staying) {
      prior.names.push_back(name);
      if (name.is_pose)
        points[name.number - first_open] = pointOf(name.number);
      else
        trunks[name.number].point = pointOf(trunks[name.number]);
    }
    else if (!name.is_pose) {
      trunks[name.number].point.reset();
      trunks[name.number].is_absorbed = options.forgets;
    }
  }
}

/// Moves the window on to the newest poses.
void Smoother::State::shrink()
{
  const auto length = static_cast<std::size_t>(options.window);
  if (poses.size() <= first_open + length)
    return;
  const std::size_t until = poses.size() - length;
  recentre();
  const std::vector<bool> stays = remembered(until);
  for (const Name &name : window_places.names) {
    if (name.is_pose || !isSolved(name) || trunks[name.number].last_seen >= until)
      continue;
    TrunkState &trunk = trunks[name.number];
    trunk.place_covariance = placeCovariance(name.number);
    if (!stays[name.number])
      trunk.covariance = trunkCovariance(name.number);
  }
  absorb(first_open, until);
  points.erase(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(until - first_open));
  first_open = until;
  if (options.forgets)
    forget(until);
}

/// Gives back what is held of poses before \p until.
void Smoother::State::forget(std::size_t until)
{
  factors.erase(factors.begin(), factors.begin() + static_cast<std::ptrdiff_t>(until - first_held));
  first_held = until;
  for (std::size_t j = 0; j < trunks.size(); ++j) {
    TrunkState &trunk = trunks[j];
    trunk.seen.erase(trunk.seen.begin(), std::lower_bound(trunk.seen.begin(), trunk.seen.end(), until));
    if (trunk.is_removed && !trunk.point && !trunk.is_free) {
      trunk.is_free = true;
      free_trunks.push_back(j);
    }
  }
}

/// Whether the last update() or optimize() took it in.
bool Smoother::State::isSolved(const Name &name) const
{
  if (!window || (name.is_pose && name.number < window_places.first_pose))
    return false;
  const std::vector<int> &list = name.is_pose ? window_places.pose : window_places.trunk;
  const std::size_t at = name.is_pose ? name.number - window_places.first_pose : name.number;
  return at < list.size() && list[at] >= 0;
}

Matrix5d Smoother::State::trunkCovariance(std::size_t trunk) const
{
  if (!isSolved({false, trunk}))
    return trunks[trunk].covariance;
  return window->covariance({{window_places.of({false, trunk}), Matrix5d::Identity()}});
}

/// Along the axes of the world there.
Smoother::State::FromPose Smoother::State::placeJacobian(const TrunkState &trunk) const
{
  const Pose &wMb = poses[trunk.last_seen];
  const Eigen::Vector2d offset = trunk.value.xy - wMb.t.head<2>();
  FromPose J;
  J << -wMb.R.topRows<2>(), Eigen::Vector2d(offset.y(), -offset.x()) * wMb.R.row(2);
  return J;
}

Eigen::Matrix2d Smoother::State::placeCovariance(std::size_t trunk) const
{
  const TrunkState &seen = trunks[trunk];
  if (!isSolved({false, trunk}) || !isSolved({true, seen.last_seen}))
    return seen.place_covariance;
  return window->covariance({{window_places.of({true, seen.last_seen}), placeJacobian(seen)},
                             {window_places.of({false, trunk}), Eigen::MatrixXd::Identity(2, 5)}});
}

Matrix6d Smoother::State::poseCovariance(std::size_t pose) const
{
  if (isSolved({true, pose}))
    return window->covariance({{window_places.of({true, pose}), Matrix6d::Identity()}});
  if (pose >= pose_covariances.size())
    throw notInitialized("pose = {}, must be in the window or taken in by optimize()", pose);
  return pose_covariances[pose];
}

/// Covariance of those coordinates of the relative trunk that \p which selects.
Eigen::MatrixXd Smoother::State::relativeCovariance(std::size_t pose, std::size_t trunk,
                                                    const Eigen::MatrixXd &which) const
{
  Matrix46d J_pose;
  Matrix45d J_trunk;
  relativeTrunk(poses[pose], options.bMc, trunks[trunk].value, &J_pose, &J_trunk);
  if (!J_pose.allFinite() || !J_trunk.allFinite())
    throw badValue("trunk = {}, must not contain the camera", trunk);
  if (isSolved({true, pose}) && isSolved({false, trunk}))
    return window->covariance(
        {{window_places.of({true, pose}), which * J_pose}, {window_places.of({false, trunk}), which * J_trunk}});
  const Matrix4d whole =
      J_pose * poseCovariance(pose) * J_pose.transpose() + J_trunk * trunkCovariance(trunk) * J_trunk.transpose();
  return which * whole * which.transpose();
}
} // namespace bole
