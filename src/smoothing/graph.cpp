// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/failure.h"
#include "smoothing/factors.h"
#include <bole/graph.h>

#include <cmath>
#include <numeric>

namespace bole
{
double cost(const Graph &graph)
{
  double sum = 0;
  const auto pose = [&](std::size_t i) -> const Pose & { return graph.poses[i].wMb; };
  for (const Graph::PosePriorEdge &edge : graph.pose_priors) {
    const Matrix6d S = squareRootInformation(edge.prior);
    sum += 0.5 * residual(edge.prior, S, pose(edge.pose), nullptr).squaredNorm();
  }
  for (const Graph::OdometryEdge &edge : graph.odometry) {
    const Matrix6d S = squareRootInformation(edge.odometry);
    sum += 0.5 * residual(edge.odometry, S, pose(edge.a), pose(edge.b), nullptr, nullptr).squaredNorm();
  }
  for (const Graph::RelativePoseEdge &edge : graph.relative_poses) {
    const Matrix5d S = squareRootInformation(edge.measurement);
    const Vector5d r = residual(edge.measurement, S, graph.bMc, pose(edge.a), pose(edge.b), nullptr, nullptr);
    sum += 0.5 * graph.direction_loss.rho(r.squaredNorm());
  }
  for (const Graph::ObservationEdge &edge : graph.observations) {
    SquareRootSummary root;
    const SummaryStatus status = squareRoot(edge.summary, root);
    if (status != SummaryStatus::ok && status != SummaryStatus::projected)
      throw badValue("summary = {}, must be positive semi-definite", toString(status));
    const Vector4d r = residual(root, graph.bMc, pose(edge.pose), graph.trunks[edge.trunk].trunk, nullptr, nullptr);
    sum += 0.5 * graph.summary_loss.rho(r.squaredNorm());
  }
  for (const Graph::TrunkVertex &vertex : graph.trunks)
    sum += 0.5 * residual(vertex.prior, vertex.trunk).squaredNorm();
  return sum;
}

namespace
{
[[noreturn]] void fail(const char *kind, std::size_t i, const char *why) { throw badValue("{} {}: {}", kind, i, why); }

/// Sets of poses that factors tie together.
struct Components
{
  explicit Components(std::size_t n) : parent(n) { std::iota(parent.begin(), parent.end(), 0); }
  std::size_t root(std::size_t i)
  {
    while (parent[i] != i)
      i = parent[i] = parent[parent[i]];
    return i;
  }
  void join(std::size_t a, std::size_t b) { parent[root(a)] = root(b); }
  std::vector<std::size_t> parent;
};

void checkVertices(const Graph &graph)
{
  for (std::size_t i = 0; i < graph.poses.size(); ++i)
    if (!graph.poses[i].wMb.isFinite())
      fail("pose", i, "must be finite");
  for (std::size_t j = 0; j < graph.trunks.size(); ++j) {
    const Graph::TrunkVertex &vertex = graph.trunks[j];
    if (!vertex.trunk.minus(Trunk()).allFinite() || !vertex.prior.mean.minus(Trunk()).allFinite())
      fail("trunk", j, "must be finite");
    if (!std::isnormal(vertex.trunk.radius()) || !std::isnormal(vertex.prior.mean.radius()))
      fail("trunk", j, "radius must be above 0 and finite");
    if (!vertex.prior.sigma.allFinite() || !(vertex.prior.sigma.array() > 0).all())
      fail("trunk", j, "sigmas of its prior must be above 0");
  }
}
} // namespace

std::optional<std::size_t> untiedPose(const Graph &graph)
{
  Components components(graph.poses.size());
  for (const Graph::OdometryEdge &edge : graph.odometry)
    components.join(edge.a, edge.b);
  std::vector<bool> anchored(graph.poses.size(), false);
  for (const Graph::PosePriorEdge &edge : graph.pose_priors)
    anchored[components.root(edge.pose)] = true;
  for (std::size_t i = 0; i < graph.poses.size(); ++i)
    if (!anchored[components.root(i)])
      return i;
  return std::nullopt;
}

void validate(const Graph &graph)
{
  checkVertices(graph);
  const std::size_t n = graph.poses.size();
  for (std::size_t i = 0; i < graph.pose_priors.size(); ++i) {
    const Graph::PosePriorEdge &edge = graph.pose_priors[i];
    if (edge.pose >= n)
      fail("pose prior", i, "must name a pose");
    if (!edge.prior.mean.isFinite())
      fail("pose prior", i, "must be finite");
    squareRootInformation(edge.prior);
  }
  for (std::size_t i = 0; i < graph.odometry.size(); ++i) {
    const Graph::OdometryEdge &edge = graph.odometry[i];
    if (edge.a >= n || edge.b >= n || edge.a == edge.b)
      fail("odometry", i, "must name two poses");
    if (!edge.odometry.aMb.isFinite())
      fail("odometry", i, "must be finite");
    squareRootInformation(edge.odometry);
  }
  for (std::size_t i = 0; i < graph.relative_poses.size(); ++i) {
    const Graph::RelativePoseEdge &edge = graph.relative_poses[i];
    if (edge.a >= n || edge.b >= n || edge.a == edge.b)
      fail("relative pose", i, "must name two poses");
    if (!edge.measurement.caRcb.allFinite() || !(std::abs(edge.measurement.direction.norm() - 1) < 1e-6))
      fail("relative pose", i, "must be finite with a direction of length 1");
    squareRootInformation(edge.measurement);
  }
  for (std::size_t i = 0; i < graph.observations.size(); ++i) {
    const Graph::ObservationEdge &edge = graph.observations[i];
    SquareRootSummary root;
    if (edge.pose >= n || edge.trunk >= graph.trunks.size())
      fail("observation", i, "must name a pose and a trunk");
    const SummaryStatus status = squareRoot(edge.summary, root);
    if (status == SummaryStatus::indefinite)
      fail("observation", i, "F must be positive semi-definite");
    if (status == SummaryStatus::not_finite)
      fail("observation", i, "must be finite");
  }
  if (const std::optional<std::size_t> pose = untiedPose(graph))
    fail("pose", *pose, "must be tied to the world by odometry and a pose prior");
}

namespace
{
/// aMb with the path of the camera on b (and a) made longer.
Pose scaledMotion(const Pose &aMb, const Pose &aMca, const Pose &bMcb, double factor)
{
  Pose caMcb = aMca.inverse() * aMb * bMcb;
  caMcb.t *= factor;
  return aMca * caMcb * bMcb.inverse();
}

Matrix6d scaledCovariance(Matrix6d covariance, double factor)
{
  covariance.topRows<3>() *= factor;
  covariance.leftCols<3>() *= factor;
  return covariance;
}
} // namespace

Graph scaled(const Graph &graph, double factor)
{
  if (!(factor > 0) || !std::isfinite(factor))
    throw badValue("factor = {:g}, must be above 0", factor);
  Graph result = graph;
  for (Graph::PoseVertex &vertex : result.poses)
    vertex.wMb = scaledMotion(vertex.wMb, Pose(), graph.bMc, factor);
  for (Graph::TrunkVertex &vertex : result.trunks) {
    vertex.trunk.xy *= factor;
    vertex.trunk.log_radius += std::log(factor);
    vertex.prior.mean.xy *= factor;
    vertex.prior.sigma.head<2>() *= factor;
  }
  for (Graph::PosePriorEdge &edge : result.pose_priors) {
    edge.prior.mean = scaledMotion(edge.prior.mean, Pose(), graph.bMc, factor);
    edge.prior.covariance = scaledCovariance(edge.prior.covariance, factor);
  }
  for (Graph::OdometryEdge &edge : result.odometry) {
    edge.odometry.aMb = scaledMotion(edge.odometry.aMb, graph.bMc, graph.bMc, factor);
    edge.odometry.covariance = scaledCovariance(edge.odometry.covariance, factor);
  }
  return result;
}
} // namespace bole
