// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The yardstick of the smoother: dense Levenberg-Marquardt on a whole graph, short and slow.

#include "smoothing/factors.h"
#include <bole/graph.h>

#include <Eigen/Cholesky>

namespace bole::test
{
class DenseReference
{
public:
  explicit DenseReference(Graph graph) : m_graph(std::move(graph)) { m_cost = cost(m_graph); }

  /// Runs to convergence; returns the final cost.
  double solve(int max_iterations = 100)
  {
    double lambda = 1e-6;
    for (int i = 0; i < max_iterations && lambda < 1e12; ++i) {
      build();
      const Eigen::VectorXd scale = H.diagonal();
      bool accepted = false;
      while (!accepted && lambda < 1e12) {
        Eigen::MatrixXd damped = H;
        damped.diagonal() += lambda * scale;
        const Eigen::VectorXd delta = damped.selfadjointView<Eigen::Lower>().llt().solve(g);
        const Graph moved = movedBy(delta);
        const double after = cost(moved);
        if (std::isfinite(after) && after <= m_cost) {
          accepted = true;
          const double decrease = m_cost - after;
          m_graph = moved;
          m_cost = after;
          lambda /= 10;
          if (decrease <= 1e-12 * m_cost)
            return m_cost;
        }
        else {
          lambda *= 10;
        }
      }
    }
    return m_cost;
  }
  const Graph &graph() const { return m_graph; }
  /// Inverse of the whole normal equations at the present values.
  Eigen::MatrixXd covariance()
  {
    build();
    const Eigen::MatrixXd full = H.selfadjointView<Eigen::Lower>();
    return full.llt().solve(Eigen::MatrixXd::Identity(H.rows(), H.cols()));
  }
  int poseRow(std::size_t i) const { return static_cast<int>(6 * i); }
  int trunkRow(std::size_t j) const { return static_cast<int>(6 * m_graph.poses.size() + 5 * j); }

private:
  template <int R, int A> void add1(int a, const Eigen::Matrix<double, R, A> &J, const Eigen::Matrix<double, R, 1> &r)
  {
    H.block<A, A>(a, a) += J.transpose() * J;
    g.segment<A>(a) -= J.transpose() * r;
  }
  template <int R, int A, int B>
  void add2(double w, int a, int b, const Eigen::Matrix<double, R, A> &J_a, const Eigen::Matrix<double, R, B> &J_b,
            const Eigen::Matrix<double, R, 1> &r)
  {
    H.block<A, A>(a, a) += w * J_a.transpose() * J_a;
    H.block<B, B>(b, b) += w * J_b.transpose() * J_b;
    if (b > a)
      H.block<B, A>(b, a) += w * J_b.transpose() * J_a;
    else
      H.block<A, B>(a, b) += w * J_a.transpose() * J_b;
    g.segment<A>(a) -= w * J_a.transpose() * r;
    g.segment<B>(b) -= w * J_b.transpose() * r;
  }

  void build()
  {
    const int n = trunkRow(m_graph.trunks.size());
    H.setZero(n, n);
    g.setZero(n);
    const auto pose = [&](std::size_t i) -> const Pose & { return m_graph.poses[i].wMb; };
    for (const auto &e : m_graph.pose_priors) {
      Matrix6d J;
      const Matrix6d S = squareRootInformation<6>(e.prior.covariance, "covariance");
      const Vector6d r = residual(e.prior, S, pose(e.pose), &J);
      add1<6, 6>(poseRow(e.pose), J, r);
    }
    for (const auto &e : m_graph.odometry) {
      Matrix6d J_a, J_b;
      const Matrix6d S = squareRootInformation<6>(e.odometry.covariance, "covariance");
      const Vector6d r = residual(e.odometry, S, pose(e.a), pose(e.b), &J_a, &J_b);
      add2<6, 6, 6>(1, poseRow(e.a), poseRow(e.b), J_a, J_b, r);
    }
    for (const auto &e : m_graph.relative_poses) {
      Matrix56d J_a, J_b;
      const Matrix5d S = squareRootInformation<5>(e.measurement.covariance, "covariance");
      const Vector5d r = residual(e.measurement, S, m_graph.bMc, pose(e.a), pose(e.b), &J_a, &J_b);
      add2<5, 6, 6>(m_graph.direction_loss.weight(r.squaredNorm()), poseRow(e.a), poseRow(e.b), J_a, J_b, r);
    }
    for (const auto &e : m_graph.observations) {
      SquareRootSummary root;
      squareRoot(e.summary, root);
      Matrix46d J_pose;
      Matrix45d J_trunk;
      const Vector4d r = residual(root, m_graph.bMc, pose(e.pose), m_graph.trunks[e.trunk].trunk, &J_pose, &J_trunk);
      add2<4, 6, 5>(m_graph.summary_loss.weight(r.squaredNorm()), poseRow(e.pose), trunkRow(e.trunk), J_pose, J_trunk,
                    r);
    }
    for (std::size_t j = 0; j < m_graph.trunks.size(); ++j) {
      const Graph::TrunkVertex &v = m_graph.trunks[j];
      const Vector5d r = residual(v.prior, v.trunk);
      add1<5, 5>(trunkRow(j), Matrix5d(v.prior.sigma.cwiseInverse().asDiagonal()), r);
    }
  }

  Graph movedBy(const Eigen::VectorXd &delta) const
  {
    Graph moved = m_graph;
    for (std::size_t i = 0; i < moved.poses.size(); ++i)
      moved.poses[i].wMb = moved.poses[i].wMb.plus(delta.segment<6>(poseRow(i)));
    for (std::size_t j = 0; j < moved.trunks.size(); ++j)
      moved.trunks[j].trunk = moved.trunks[j].trunk.plus(delta.segment<5>(trunkRow(j)));
    return moved;
  }

  Graph m_graph;
  double m_cost = 0;
  Eigen::MatrixXd H; // lower triangle
  Eigen::VectorXd g;
};
} // namespace bole::test
