// SPDX-License-Identifier: GPL-2.0-or-later
// What the quadratics cost in accuracy (paper, Eq. 9 against Eq. 2), and what they save. The graph
// of `bole track` is solved three times: with its summary factors as they are; with summary factors
// made anew at the same optima from the kept images; and with the images themselves, whose energy,
// gradient and Hessian are taken again at every view's present relative trunk in each iteration.
// benchmark_smoothing_fidelity [sequence ...]
#include "smoothing/factors.h"

#include "evaluation/trajectory_metrics.h"
#include "pipeline/engine.h"
#include <bole/open_source.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fmt/core.h>

namespace
{
using namespace bole;

/// One view of a trunk with the image it came from.
struct ImageView
{
  std::size_t gradient = 0;
  ElevationRange range;
  BorderTarget left, right;
};

struct Flight
{
  StageOptions options;
  PinholeCamera camera;
  Graph graph;                     ///< at the optimum of its summary factors
  std::vector<Gradient> gradients; ///< of each pose
  std::vector<ImageView> views;    ///< of each observation of the graph
  Trajectory stamps;
  std::vector<std::int64_t> confirmed; ///< ids in the graph
  std::vector<PosePair> truth;
  std::vector<TruthTrunk> trees;
};

TrunkEnergy energyOf(const Flight &flight, const ImageView &view)
{
  return {flight.gradients[view.gradient], flight.camera, view.range, view.left, view.right,
          flight.options.tracking.energy};
}

/// Which borders the tracker used, and over which rows, as far as the graph tells: a summary
/// without information on r/d beside the bearing came from one border.
ImageView viewOf(const Flight &flight, const Graph::ObservationEdge &edge)
{
  ImageView view;
  view.gradient = edge.pose;
  const Pose wMc = flight.graph.poses[edge.pose].wMb * flight.graph.bMc;
  const double r = flight.graph.trunks[edge.trunk].trunk.radius();
  const double d = r / edge.summary.optimum.ratio();
  const double tangent = std::sqrt(std::max(d * d - r * r, 0.01));
  view.range = {(flight.options.flow.trunk_low - wMc.t.z()) / tangent,
                (flight.options.flow.trunk_high - wMc.t.z()) / tangent};
  double closest = 1e300;
  for (const auto &[left, right] : {std::pair{true, true}, {true, false}, {false, true}}) {
    ImageView one = view;
    one.left.visible = left;
    one.right.visible = right;
    const TrunkEnergy energy = energyOf(flight, one);
    one.left.contrast = std::abs(energy.contrastAt(edge.summary.optimum, Border::left));
    one.right.contrast = std::abs(energy.contrastAt(edge.summary.optimum, Border::right));
    const Matrix4d F = energyOf(flight, one).curvature(edge.summary.optimum).F;
    const double apart = (F - edge.summary.F).norm();
    if (apart < closest) {
      closest = apart;
      view = one;
    }
  }
  return view;
}

Flight fly(const std::string &sequence)
{
  Flight flight;
  const auto source = openSource(sequence);
  flight.camera = source->camera();
  Engine pipeline(source->camera(), source->bMc(), flight.options);
  while (true) {
    Frame frame;
    if (!source->next(frame))
      break;
    pipeline.process(frame);
    flight.gradients.push_back(computeGradient(frame.image, flight.options.gradient));
  }
  pipeline.finish();
  flight.graph = pipeline.graph();
  for (const auto &edge : flight.graph.observations)
    flight.views.push_back(viewOf(flight, edge));
  for (const MapTrunk &trunk : pipeline.trunks().trunks())
    if (!trunk.removed && trunk.status == TrunkStatus::confirmed)
      flight.confirmed.push_back(static_cast<std::int64_t>(flight.graph.poses.size() + trunk.smoother_id));
  for (const auto &pose : pipeline.smoothedTrajectory())
    flight.stamps.push_back({pose.stamp_ns, pose.wMb});
  flight.truth = pairPoses(flight.stamps, readAslTrajectory(sequence + "/mav0/state_groundtruth_estimate0/data.csv"));
  flight.trees = readTruthTrunks(sequence);
  return flight;
}

RelativeTrunk relativeAt(const Graph &graph, std::size_t edge)
{
  const auto &o = graph.observations[edge];
  return relativeTrunk(graph.poses[o.pose].wMb, graph.bMc, graph.trunks[o.trunk].trunk);
}

/// Eq. 2: the images' energies and all that is no image.
double imageCost(const Flight &flight, const Graph &graph)
{
  Graph rest = graph;
  rest.observations.clear();
  double sum = cost(rest);
  for (std::size_t i = 0; i < flight.views.size(); ++i)
    sum += energyOf(flight, flight.views[i]).evaluate(relativeAt(graph, i));
  return sum;
}

/// Every view's quadratic anew from its image, at the point that \p at gives; where a border has left
/// the image there is none, and the view keeps what it had.
template <typename Point> Graph expanded(const Flight &flight, Graph graph, const Point &at)
{
  graph.summary_loss.kind = LossKind::quadratic;
  for (std::size_t i = 0; i < flight.views.size(); ++i) {
    const TrunkEnergy energy = energyOf(flight, flight.views[i]);
    SummaryFactor summary;
    summary.optimum = at(i);
    summary.energy = energy.evaluate(summary.optimum, &summary.f);
    summary.F = energy.curvature(summary.optimum).F;
    if (std::isfinite(summary.energy) && summary.f.allFinite() && summary.F.allFinite())
      graph.observations[i].summary = summary;
  }
  return graph;
}

Graph optimum(const Graph &graph)
{
  Smoother smoother(graph, SmootherOptions());
  smoother.optimize(1e-10);
  Graph solved = graph;
  for (std::size_t i = 0; i < solved.poses.size(); ++i)
    solved.poses[i].wMb = smoother.pose(i);
  for (std::size_t j = 0; j < solved.trunks.size(); ++j)
    solved.trunks[j].trunk = smoother.trunk(j);
  return solved;
}

Graph between(const Graph &from, const Graph &to, double share)
{
  Graph graph = from;
  for (std::size_t i = 0; i < graph.poses.size(); ++i)
    graph.poses[i].wMb = from.poses[i].wMb.plus(share * to.poses[i].wMb.minus(from.poses[i].wMb));
  for (std::size_t j = 0; j < graph.trunks.size(); ++j)
    graph.trunks[j].trunk = from.trunks[j].trunk.plus(share * to.trunks[j].trunk.minus(from.trunks[j].trunk));
  return graph;
}

/// Gauss-Newton on the images themselves, with a line search on their cost.
Graph optimumOfImages(const Flight &flight, Graph graph, int &iterations)
{
  double before = imageCost(flight, graph);
  for (iterations = 0; iterations < 40; ++iterations) {
    const Graph goal = optimum(expanded(flight, graph, [&](std::size_t i) { return relativeAt(graph, i); }));
    double share = 1;
    Graph moved = between(graph, goal, share);
    while (share > 1e-4 && !(imageCost(flight, moved) < before))
      moved = between(graph, goal, share *= 0.5);
    const double after = imageCost(flight, moved);
    if (!(after < before - 1e-6))
      break;
    graph = moved;
    before = after;
  }
  return graph;
}

struct Errors
{
  std::size_t matched = 0;
  double map_rmse = 0, radius_rmse = 0, ate = 0; ///< [m], aligned in x, y, yaw
};

/// Confirmed trunks at 1.3 m against the nearest tree within 1 m.
Errors errorsOf(const Flight &flight, const Graph &graph)
{
  std::vector<PosePair> pairs = flight.truth;
  for (PosePair &pair : pairs)
    for (std::size_t i = 0; i < flight.stamps.size(); ++i)
      if (flight.stamps[i].stamp_ns == pair.stamp_ns)
        pair.estimate = graph.poses[i].wMb;
  const PlanarTransform transform = align(pairs, Alignment::xy_yaw);
  Errors errors;
  for (const PosePair &pair : pairs)
    errors.ate += (transform * pair.estimate.t - pair.truth.t).squaredNorm();
  errors.ate = std::sqrt(errors.ate / static_cast<double>(pairs.size()));
  for (const auto &vertex : graph.trunks) {
    if (std::find(flight.confirmed.begin(), flight.confirmed.end(), vertex.id) == flight.confirmed.end())
      continue;
    const Eigen::Vector2d xy = transform * Eigen::Vector2d(vertex.trunk.axisAt(1.3).head<2>());
    const auto nearest =
        std::min_element(flight.trees.begin(), flight.trees.end(), [&](const TruthTrunk &l, const TruthTrunk &r) {
          return (l.xy - xy).norm() < (r.xy - xy).norm();
        });
    if (nearest == flight.trees.end() || (nearest->xy - xy).norm() > 1)
      continue;
    ++errors.matched;
    errors.map_rmse += (nearest->xy - xy).squaredNorm();
    errors.radius_rmse += std::pow(vertex.trunk.radius() - nearest->radius, 2);
  }
  const double n = std::max<double>(1, static_cast<double>(errors.matched));
  errors.map_rmse = std::sqrt(errors.map_rmse / n);
  errors.radius_rmse = std::sqrt(errors.radius_rmse / n);
  return errors;
}

/// Microseconds of one call, the least of five rounds.
template <typename Call> double microseconds(int calls, const Call &call)
{
  double least = 1e300;
  for (int round = 0; round < 5; ++round) {
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < calls; ++i)
      call(static_cast<std::size_t>(i));
    const std::chrono::duration<double, std::micro> us = std::chrono::steady_clock::now() - start;
    least = std::min(least, us.count() / calls);
  }
  return least;
}

void printCosts(const Flight &flight)
{
  std::vector<SquareRootSummary> roots(flight.views.size());
  for (std::size_t i = 0; i < roots.size(); ++i)
    squareRoot(flight.graph.observations[i].summary, roots[i]);
  double sink = 0;
  const int n = static_cast<int>(roots.size());
  Matrix46d J_pose;
  Matrix45d J_trunk;
  const auto pose = [&](std::size_t i) -> const Pose & {
    return flight.graph.poses[flight.graph.observations[i].pose].wMb;
  };
  const auto trunk = [&](std::size_t i) -> const Trunk & {
    return flight.graph.trunks[flight.graph.observations[i].trunk].trunk;
  };
  const double value = microseconds(n, [&](std::size_t i) {
    sink += residual(roots[i], flight.graph.bMc, pose(i), trunk(i), nullptr, nullptr).norm();
  });
  const double jacobians = microseconds(n, [&](std::size_t i) {
    sink += residual(roots[i], flight.graph.bMc, pose(i), trunk(i), &J_pose, &J_trunk).norm();
  });
  const double energy = microseconds(
      n, [&](std::size_t i) { sink += energyOf(flight, flight.views[i]).evaluate(relativeAt(flight.graph, i)); });
  const double hessian = microseconds(n, [&](std::size_t i) {
    Vector4d f;
    const RelativeTrunk relative = relativeAt(flight.graph, i);
    const TrunkEnergy image = energyOf(flight, flight.views[i]);
    sink += image.evaluate(relative, &f) + image.curvature(relative).F(0, 0);
  });
  vpImage<unsigned char> picture(240, 320, 100);
  const double gradient =
      microseconds(20, [&](std::size_t) { sink += computeGradient(picture, flight.options.gradient).signed_x[9][9]; });
  fmt::print("  us a view: summary {:.2f}, with Jacobians {:.2f}; image with its gradient kept in "
             "memory {:.2f} ({:.1f} times), with gradient and Hessian {:.2f} ({:.1f} times); from "
             "pixels {:.0f} ({:.0f} times){}\n",
             value, jacobians, energy, energy / value, hessian, hessian / jacobians, gradient + energy,
             (gradient + energy) / value, std::isfinite(sink) ? "" : " ");
}
} // namespace

int main(int argc, char **argv)
{
  std::vector<std::string> flights(argv + 1, argv + argc);
  if (flights.empty())
    for (const char *name : {"park-forward", "winter-weave", "pine-arc"})
      flights.push_back(std::string(BOLE_SHARED_DATA_DIR) + "/rendered/" + name);
  for (const std::string &sequence : flights) {
    const Flight flight = fly(sequence);
    const Graph &summaries = flight.graph;
    const Graph anew =
        optimum(expanded(flight, summaries, [&](std::size_t i) { return summaries.observations[i].summary.optimum; }));
    int iterations = 0;
    const Graph images = optimumOfImages(flight, summaries, iterations);
    const Errors reference = errorsOf(flight, images);
    fmt::print("{}: {} poses, {} views, {} confirmed trunks near a tree; {} iterations on the images\n", sequence,
               summaries.poses.size(), flight.views.size(), reference.matched, iterations);
    for (const auto &[name, graph] : {std::pair<const char *, const Graph *>{"images (Eq. 2)", &images},
                                      {"summary factors", &summaries},
                                      {"the same, no loss", &anew}}) {
      const Errors errors = errorsOf(flight, *graph);
      double apart = 0;
      for (std::size_t j = 0; j < graph->trunks.size(); ++j)
        apart = std::max(apart, std::find(flight.confirmed.begin(), flight.confirmed.end(), graph->trunks[j].id) ==
                                        flight.confirmed.end()
                                    ? 0
                                    : (graph->trunks[j].trunk.axisAt(1.3) - images.trunks[j].trunk.axisAt(1.3)).norm());
      fmt::print("  {:18s} map RMSE {:.4f} m ({:+.1f} %), radius RMSE {:.4f} m, ATE {:.4f} m ({:+.1f} "
                 "%), farthest trunk from the images' {:.3f} m, cost by the images {:.2f}\n",
                 name, errors.map_rmse, 100 * (errors.map_rmse / reference.map_rmse - 1), errors.radius_rmse,
                 errors.ate, 100 * (errors.ate / reference.ate - 1), apart, imageCost(flight, *graph));
    }
    printCosts(flight);
    std::fflush(stdout);
  }
}
