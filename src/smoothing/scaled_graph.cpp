// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/graph.h>

#include <cmath>
#include <visp3/core/vpException.h>

namespace bole
{
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
    throw vpException(vpException::badValue, "factor = %g, must be above 0", factor);
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
