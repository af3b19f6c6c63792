// SPDX-License-Identifier: GPL-2.0-or-later
#include "paper/tree_energy.h"

#include <Eigen/Geometry>
#include <Eigen/Sparse>
#include <Eigen/SparseCholesky>
#include <cmath>
#include <visp3/core/vpException.h>

namespace bole::paper
{
namespace
{
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Sparse = Eigen::SparseMatrix<double>;

Matrix3d skew(const Vector3d &a)
{
  return (Matrix3d() << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0).finished();
}

/// By how much Log(Exp(phi) Exp(d)) moves with d.
Matrix3d inverseRightJacobian(const Vector3d &phi)
{
  const double angle = phi.norm();
  const double quadratic =
      angle < 1e-4 ? 1.0 / 12 : 1 / (angle * angle) - (1 + std::cos(angle)) / (2 * angle * std::sin(angle));
  return Matrix3d::Identity() + 0.5 * skew(phi) + quadratic * skew(phi) * skew(phi);
}

/// H delta = g: six numbers a pose, then five a tree; of H the lower triangle.
class NormalEquations
{
public:
  NormalEquations(const Graph &graph, const TreeEnergy *image, const std::vector<std::size_t> &observed)
      : m_graph(graph), m_g(Eigen::VectorXd::Zero(atTree(graph.trunks.size())))
  {
    for (const Graph::PosePriorEdge &edge : graph.pose_priors)
      add(edge);
    for (const Graph::OdometryEdge &edge : graph.odometry)
      add(edge);
    for (std::size_t j = 0; j < graph.trunks.size(); ++j)
      addPrior(j);
    for (const Graph::ObservationEdge &edge : graph.observations)
      add(edge);
    for (const std::size_t tree : observed) {
      const std::size_t newest = graph.poses.size() - 1;
      const RelativeTrunk seen = relativeTrunk(graph.poses[newest].wMb, graph.bMc, graph.trunks[tree].trunk);
      add({newest, tree, convexified(image->expand(seen), pixelSteps(image->camera(), seen))});
    }
    m_H.resize(m_g.size(), m_g.size());
    m_H.setFromTriplets(m_terms.begin(), m_terms.end());
  }

  const Sparse &H() const { return m_H; }
  const Eigen::VectorXd &g() const { return m_g; }
  Eigen::Index atPose(std::size_t pose) const { return static_cast<Eigen::Index>(6 * pose); }
  Eigen::Index atTree(std::size_t tree) const { return static_cast<Eigen::Index>(6 * m_graph.poses.size() + 5 * tree); }

private:
  void add(const Graph::PosePriorEdge &edge)
  {
    const Pose &wMb = m_graph.poses[edge.pose].wMb;
    const Vector6d r = wMb.minus(edge.prior.mean);
    Matrix6d J = Matrix6d::Zero();
    J.topLeftCorner<3, 3>() = edge.prior.mean.R.transpose() * wMb.R;
    J.bottomRightCorner<3, 3>() = inverseRightJacobian(r.tail<3>());
    const Matrix6d information = edge.prior.covariance.inverse();
    addBlock(atPose(edge.pose), J, atPose(edge.pose), J, information);
    m_g.segment<6>(atPose(edge.pose)) -= J.transpose() * information * r;
  }

  void add(const Graph::OdometryEdge &edge)
  {
    const Pose aMb = m_graph.poses[edge.a].wMb.inverse() * m_graph.poses[edge.b].wMb;
    const Vector6d r = aMb.minus(edge.odometry.aMb);
    const Matrix3d Rm = edge.odometry.aMb.R.transpose(), by_turn = inverseRightJacobian(r.tail<3>());
    Matrix6d J_a = Matrix6d::Zero(), J_b = Matrix6d::Zero();
    J_a.topLeftCorner<3, 3>() = -Rm;
    J_a.topRightCorner<3, 3>() = Rm * skew(aMb.t);
    J_a.bottomRightCorner<3, 3>() = -by_turn * aMb.R.transpose();
    J_b.topLeftCorner<3, 3>() = Rm * aMb.R;
    J_b.bottomRightCorner<3, 3>() = by_turn;
    const Matrix6d information = edge.odometry.covariance.inverse();
    addPair(atPose(edge.a), J_a, atPose(edge.b), J_b, information, Vector6d(information * r));
  }

  void addPrior(std::size_t tree)
  {
    const TrunkPrior &prior = m_graph.trunks[tree].prior;
    const Matrix5d J = Matrix5d::Identity(), information = prior.sigma.cwiseAbs2().cwiseInverse().asDiagonal();
    addBlock(atTree(tree), J, atTree(tree), J, information);
    m_g.segment<5>(atTree(tree)) -= information * m_graph.trunks[tree].trunk.minus(prior.mean);
  }

  void add(const Graph::ObservationEdge &edge)
  {
    Matrix46d J_pose;
    Matrix45d J_tree;
    const RelativeTrunk seen =
        relativeTrunk(m_graph.poses[edge.pose].wMb, m_graph.bMc, m_graph.trunks[edge.trunk].trunk, &J_pose, &J_tree);
    const Vector4d d = seen.minus(edge.summary.optimum);
    Matrix4d J = Matrix4d::Identity();
    J.topLeftCorner<3, 3>() = inverseRightJacobian(d.head<3>());
    if (d.allFinite() && edge.summary.F.allFinite() && edge.summary.f.allFinite()) // else nothing is known there
      addPair(atPose(edge.pose), Matrix46d(J * J_pose), atTree(edge.trunk), Matrix45d(J * J_tree), edge.summary.F,
              Vector4d(edge.summary.F * d + edge.summary.f));
  }

  /// \p force: derivative of the energy by the residual.
  template <int Rows, int A, int B>
  void addPair(Eigen::Index a, const Eigen::Matrix<double, Rows, A> &J_a, Eigen::Index b,
               const Eigen::Matrix<double, Rows, B> &J_b, const Eigen::Matrix<double, Rows, Rows> &information,
               const Eigen::Matrix<double, Rows, 1> &force)
  {
    addBlock(a, J_a, a, J_a, information);
    addBlock(b, J_b, a, J_a, information); // b stands after a
    addBlock(b, J_b, b, J_b, information);
    m_g.segment<A>(a) -= J_a.transpose() * force;
    m_g.segment<B>(b) -= J_b.transpose() * force;
  }

  template <int Rows, int A, int B>
  void addBlock(Eigen::Index row, const Eigen::Matrix<double, Rows, A> &J_row, Eigen::Index column,
                const Eigen::Matrix<double, Rows, B> &J_column, const Eigen::Matrix<double, Rows, Rows> &information)
  {
    const Eigen::Matrix<double, A, B> block = J_row.transpose() * information * J_column;
    for (int j = 0; j < B; ++j)
      for (int i = 0; i < A; ++i)
        if (row + i >= column + j)
          m_terms.emplace_back(row + i, column + j, block(i, j));
  }

  const Graph &m_graph;
  std::vector<Eigen::Triplet<double>> m_terms;
  Sparse m_H;
  Eigen::VectorXd m_g;
};

/// Eq. 2 and 4: odometry, priors and summaries are a sum of squares, the newest image the energies of its trees.
double totalOf(const Graph &graph, const TreeEnergy *image, const std::vector<std::size_t> &observed)
{
  double total = cost(graph);
  for (const std::size_t tree : observed)
    total += image->evaluate(relativeTrunk(graph.poses.back().wMb, graph.bMc, graph.trunks[tree].trunk));
  return total;
}

/// The step with \p damping on the diagonal.
Eigen::VectorXd solve(const NormalEquations &at, double damping)
{
  Sparse H = at.H();
  for (Eigen::Index i = 0; i < H.rows(); ++i)
    H.coeffRef(i, i) *= 1 + damping;
  return Eigen::SimplicialLDLT<Sparse>(H).solve(at.g());
}

void moveBy(Graph &graph, const NormalEquations &at, const Eigen::VectorXd &step)
{
  for (std::size_t i = 0; i < graph.poses.size(); ++i)
    graph.poses[i].wMb = graph.poses[i].wMb.plus(step.segment<6>(at.atPose(i)));
  for (std::size_t j = 0; j < graph.trunks.size(); ++j)
    graph.trunks[j].trunk = graph.trunks[j].trunk.plus(step.segment<5>(at.atTree(j)));
}
} // namespace

void optimiseJointly(Graph &graph, const TreeEnergy *image, const std::vector<std::size_t> &observed)
{
  constexpr int kIterations = 100;
  constexpr double kSettled = 1e-8; // share of the sum by which it still falls at the end
  double before = totalOf(graph, image, observed), damping = 0;
  if (!std::isfinite(before))
    throw vpException(vpException::divideByZeroError, "paper: frame %zu: the joint energy is not finite",
                      graph.poses.size() - 1);
  std::optional<NormalEquations> at;
  for (int i = 0; i < kIterations; ++i) {
    if (!at)
      at.emplace(graph, image, observed);
    const std::vector<Graph::PoseVertex> poses = graph.poses;
    const std::vector<Graph::TrunkVertex> trunks = graph.trunks;
    moveBy(graph, *at, solve(*at, damping));
    const double after = totalOf(graph, image, observed), fall = before - after;
    if (std::isfinite(after) && fall >= 0) {
      if (fall <= kSettled * std::abs(before))
        return;
      before = after;
      damping = damping < 1e-7 ? 0 : damping / 10;
      at.reset();
      continue;
    }
    graph.poses = poses;
    graph.trunks = trunks;
    if (damping > 1e12 || (damping == 0 && fall >= -kSettled * std::max(1.0, std::abs(before)))) // rounding
      return;
    damping = damping == 0 ? 1e-6 : damping * 10;
  }
}

std::vector<Matrix5d> treeCovariances(const Graph &graph)
{
  const NormalEquations at(graph, nullptr, {});
  const Eigen::SimplicialLDLT<Sparse> solver(at.H());
  std::vector<Matrix5d> covariances;
  for (std::size_t j = 0; j < graph.trunks.size(); ++j) {
    Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(at.g().size(), 5);
    columns.block<5, 5>(at.atTree(j), 0).setIdentity();
    covariances.emplace_back(solver.solve(columns).block<5, 5>(at.atTree(j), 0));
  }
  return covariances;
}
} // namespace bole::paper
