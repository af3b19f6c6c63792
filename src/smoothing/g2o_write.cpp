// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/atomic_file.h"
#include <bole/graph.h>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <fmt/core.h>
#include <ostream>
#include <sstream>

namespace bole
{
namespace
{
void put(std::ostream &out, double value) { out << fmt::format(" {:.17g}", value); }

template <typename Derived> void put(std::ostream &out, const Eigen::MatrixBase<Derived> &vector)
{
  for (Eigen::Index i = 0; i < vector.size(); ++i)
    put(out, vector(i));
}

void put(std::ostream &out, const Eigen::Matrix3d &R)
{
  const Eigen::Quaterniond q(R);
  for (const double value : {q.x(), q.y(), q.z(), q.w()})
    put(out, value);
}

void put(std::ostream &out, const Pose &pose)
{
  put(out, pose.t);
  put(out, pose.R);
}

template <int N> void putUpper(std::ostream &out, const Eigen::Matrix<double, N, N> &symmetric)
{
  for (int r = 0; r < N; ++r)
    for (int c = r; c < N; ++c)
      put(out, symmetric(r, c));
}

/// Of g2o's error (t, vector part of the quaternion).
void putInformation(std::ostream &out, const Matrix6d &covariance)
{
  Vector6d scale;
  scale << 1, 1, 1, 2, 2, 2;
  const Matrix6d information = covariance.inverse();
  putUpper<6>(out, scale.asDiagonal() * (0.5 * (information + information.transpose())) * scale.asDiagonal());
}

Vector5d numbers(const Trunk &trunk) { return trunk.minus(Trunk{{0, 0}, 0, {0, 0}}); }
} // namespace

void writeG2o(std::ostream &out, const Graph &graph)
{
  out << "PARAMS_SE3OFFSET 0";
  put(out, graph.bMc);
  out << fmt::format("\nLOSS summary {} {:.17g}\n", toString(graph.summary_loss.kind), graph.summary_loss.width);
  out << fmt::format("LOSS direction {} {:.17g}\n", toString(graph.direction_loss.kind), graph.direction_loss.width);
  for (const Graph::PoseVertex &vertex : graph.poses) {
    out << "VERTEX_SE3:QUAT " << vertex.id;
    put(out, vertex.wMb);
    out << '\n';
  }
  for (const Graph::TrunkVertex &vertex : graph.trunks) {
    out << "VERTEX_TRUNK " << vertex.id;
    put(out, numbers(vertex.trunk));
    put(out, numbers(vertex.prior.mean));
    put(out, vertex.prior.sigma);
    out << '\n';
  }
  const auto pose = [&](std::size_t i) { return graph.poses[i].id; };
  for (const Graph::PosePriorEdge &edge : graph.pose_priors) {
    out << "EDGE_SE3_PRIOR:QUAT " << pose(edge.pose);
    put(out, edge.prior.mean);
    putInformation(out, edge.prior.covariance);
    out << '\n';
  }
  for (const Graph::OdometryEdge &edge : graph.odometry) {
    out << "EDGE_SE3:QUAT " << pose(edge.a) << ' ' << pose(edge.b);
    put(out, edge.odometry.aMb);
    putInformation(out, edge.odometry.covariance);
    out << '\n';
  }
  for (const Graph::RelativePoseEdge &edge : graph.relative_poses) {
    out << "EDGE_DIRECTION " << pose(edge.a) << ' ' << pose(edge.b);
    put(out, edge.measurement.caRcb);
    put(out, edge.measurement.direction);
    putUpper<5>(out, edge.measurement.covariance);
    out << '\n';
  }
  for (const Graph::ObservationEdge &edge : graph.observations) {
    out << "EDGE_TRUNK_SUMMARY " << pose(edge.pose) << ' ' << graph.trunks[edge.trunk].id;
    put(out, edge.summary.optimum.cRt);
    put(out, edge.summary.optimum.log_ratio);
    put(out, edge.summary.energy);
    put(out, edge.summary.f);
    putUpper<4>(out, edge.summary.F);
    out << '\n';
  }
}

void writeG2o(const std::string &path, const Graph &graph)
{
  std::ostringstream text;
  writeG2o(text, graph);
  writeAtomically(path, text.str());
}
} // namespace bole
