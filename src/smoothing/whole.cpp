// SPDX-License-Identifier: GPL-2.0-or-later
// For the whole: Levenberg-Marquardt on all factors of the flight.
#include "smoothing/state.h"

#include <algorithm>

namespace bole
{
Places Smoother::State::placeWhole() const
{
  Places places;
  places.first_pose = first_held;
  for (std::size_t i = first_held; i < poses.size(); ++i)
    places.take({true, i});
  for (std::size_t j = 0; j < trunks.size(); ++j)
    if (!trunks[j].is_removed)
      places.take({false, j});
  return places;
}

double Smoother::State::addWhole(const Places &places, NormalEquations *system) const
{
  double cost = 0;
  for (const Name &name : places.names)
    cost += name.is_pose ? add(name.number, places, system) : addTrunkPrior(name.number, places, system);
  return cost;
}

void Smoother::State::keepCovariances(const Places &places, const std::vector<int> &variables, const Eigen::MatrixXd &C)
{
  std::vector<std::pair<std::size_t, int>> rows; // of poses
  int row = 0;
  for (const int v : variables) {
    const Name &name = places.names[v];
    if (name.is_pose) {
      pose_covariances[name.number] = C.block<6, 6>(row, row);
      rows.emplace_back(name.number, row);
    }
    row += places.dims[v];
  }
  row = 0;
  for (const int v : variables) {
    const Name &name = places.names[v];
    if (!name.is_pose) {
      TrunkState &trunk = trunks[name.number];
      trunk.covariance = C.block<5, 5>(row, row);
      for (const auto &[pose, from] : rows)
        if (pose == trunk.last_seen) { // a view couples them, so they stand together in one of the nodes
          const FromPose J = placeJacobian(trunk);
          const Eigen::Matrix2d cross = J * C.block<6, 2>(from, row);
          trunk.place_covariance =
              J * C.block<6, 6>(from, from) * J.transpose() + C.block<2, 2>(row, row) + cross + cross.transpose();
        }
    }
    row += places.dims[v];
  }
}

UpdateResult Smoother::State::solveWhole(double tolerance, int max_iterations, bool with_covariances)
{
  for (const Name &name : prior.names) // nothing but the factors themselves counts
    if (!name.is_pose)
      trunks[name.number].point.reset();
  points.assign(points.size(), std::nullopt);
  prior = WindowPrior();
  UpdateResult result;
  const Places places = placeWhole();
  NormalEquations system(places.dims);
  result.cost = addWhole(places, &system);
  system.plan(system.orderOfLittleFill());
  double damping = 0;
  bool is_settled = false;
  int held = 0;
  while (!is_settled && result.iterations < max_iterations) {
    held = system.factorise(damping);
    const std::vector<Pose> poses_before = poses;
    std::vector<Trunk> trunks_before;
    for (const TrunkState &trunk : trunks)
      trunks_before.push_back(trunk.value);
    move(places, system);
    ++result.iterations;
    const double after = addWhole(places, nullptr), fall = result.cost - after;
    if (std::isfinite(after) && fall >= -1e-13 * std::abs(result.cost)) { // an image's energy is below zero
      is_settled = fall <= tolerance * std::abs(result.cost);
      result.cost = after;
      damping = damping < 1e-7 ? 0 : damping / 10;
      if (!is_settled || with_covariances) {
        system.clear();
        addWhole(places, &system);
      }
    }
    else {
      poses = poses_before;
      for (std::size_t j = 0; j < trunks.size(); ++j)
        trunks[j].value = trunks_before[j];
      is_settled = damping > 1e12 || (damping == 0 && fall >= -tolerance * std::max(1.0, std::abs(result.cost)));
      damping = damping == 0 ? 1e-6 : damping * 10;
    }
  }
  result.status = held > 0 ? UpdateStatus::degenerate : !is_settled ? UpdateStatus::iteration_limit : UpdateStatus::ok;
  if (with_covariances) {
    system.factorise();
    pose_covariances.resize(poses.size());
    system.sparseInverse(
        [&](const std::vector<int> &variables, const Eigen::MatrixXd &C) { keepCovariances(places, variables, C); });
  }
  const auto length = static_cast<std::size_t>(options.window);
  first_open = std::max(first_open, poses.size() - std::min(poses.size(), length));
  points.assign(poses.size() - first_open, std::nullopt);
  absorb(first_held, first_open);
  return result;
}

/// Where what left the window is forgotten, the window is the whole.
UpdateResult Smoother::State::optimize(double tolerance, int max_iterations)
{
  UpdateResult result;
  if (poses.empty())
    return result;
  is_whole_due = false;
  if (!options.forgets)
    result = solveWhole(tolerance, max_iterations, true);
  placeWindow();
  UpdateResult step;
  double before = solveWindow(step);
  while (options.forgets && result.iterations < max_iterations) {
    move(window_places, *window);
    ++result.iterations;
    ++step.iterations;
    result.cost = solveWindow(step);
    if (std::abs(before - result.cost) <= tolerance * std::abs(before))
      break;
    before = result.cost;
  }
  return result;
}

Graph Smoother::State::graph() const
{
  Graph graph;
  graph.bMc = options.bMc;
  graph.summary_loss = options.summary_loss;
  graph.direction_loss = options.direction_loss;
  for (std::size_t i = first_held; i < poses.size(); ++i)
    graph.poses.push_back({static_cast<std::int64_t>(i), poses[i]});
  std::vector<std::size_t> place(trunks.size(), 0);
  for (std::size_t j = 0; j < trunks.size(); ++j) {
    if (trunks[j].is_removed || (options.forgets && !trunks[j].point && trunks[j].seen.empty()))
      continue;
    place[j] = graph.trunks.size();
    graph.trunks.push_back({static_cast<std::int64_t>(poses.size() + j), trunks[j].value, trunks[j].prior});
  }
  if (first_held > 0) // what was forgotten, reduced to the first pose that was not
    graph.pose_priors.push_back({0, {poses[first_held], poseCovariance(first_held)}});
  for (std::size_t i = first_held; i < poses.size(); ++i) {
    const FactorsOfPose &all = factorsOf(i);
    for (const AbsoluteFactor &factor : all.absolutes)
      graph.pose_priors.push_back({i - first_held, factor.measured});
    for (const StepFactor &factor : all.steps)
      graph.odometry.push_back({factor.a - first_held, factor.b - first_held, factor.measured});
    for (const DirectionFactor &factor : all.directions)
      graph.relative_poses.push_back({factor.a - first_held, factor.b - first_held, factor.measured});
    for (const ViewFactor &factor : all.views)
      graph.observations.push_back({i - first_held, place[factor.trunk], factor.seen.factor()});
  }
  return graph;
}
} // namespace bole
