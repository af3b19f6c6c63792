// SPDX-License-Identifier: GPL-2.0-or-later
// The same graphs by Ceres: same optimum? And one incremental update against one re-solve.
// benchmark_smoothing_ceres [poses]
#include "smoothing/factors.h"
#include "support/flight.h"

#include <ceres/ceres.h>
#include <ctime>
#include <fmt/core.h>

namespace
{
using namespace bole;
double threadMs()
{
  timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

using PoseBlock = std::array<double, 12>;
PoseBlock toBlock(const Pose &pose)
{
  PoseBlock block;
  Eigen::Map<Eigen::Matrix3d>(block.data()) = pose.R;
  Eigen::Map<Eigen::Vector3d>(block.data() + 9) = pose.t;
  return block;
}
Pose fromBlock(const double *block)
{
  return {Eigen::Map<const Eigen::Matrix3d>(block), Eigen::Map<const Eigen::Vector3d>(block + 9)};
}
Trunk trunkFrom(const double *v) { return {{v[0], v[1]}, v[2], {v[3], v[4]}}; }

/// Jacobians reach Ceres as [J_tangent 0]; with this Plus Jacobian [I; 0] the product is the
/// tangent's.
struct PoseManifold : ceres::Manifold
{
  int AmbientSize() const override { return 12; }
  int TangentSize() const override { return 6; }
  bool Plus(const double *x, const double *d, double *y) const override
  {
    const PoseBlock block = toBlock(fromBlock(x).plus(Eigen::Map<const Vector6d>(d)));
    std::copy(block.begin(), block.end(), y);
    return true;
  }
  bool PlusJacobian(const double *, double *J) const override
  {
    Eigen::Map<Eigen::Matrix<double, 12, 6, Eigen::RowMajor>> M(J);
    M.setIdentity();
    return true;
  }
  bool Minus(const double *y, const double *x, double *d) const override
  {
    Eigen::Map<Vector6d> out(d);
    out = fromBlock(y).minus(fromBlock(x));
    return true;
  }
  bool MinusJacobian(const double *, double *J) const override
  {
    Eigen::Map<Eigen::Matrix<double, 6, 12, Eigen::RowMajor>> M(J);
    M.setIdentity();
    return true;
  }
};

template <int R, int N> void putPose(const Eigen::Matrix<double, R, N> &J, double *out)
{
  Eigen::Map<Eigen::Matrix<double, R, 12, Eigen::RowMajor>> M(out);
  M.setZero();
  M.template leftCols<6>() = J;
}

struct PriorCost : ceres::SizedCostFunction<6, 12>
{
  PosePrior prior;
  Matrix6d S;
  bool Evaluate(double const *const *x, double *r, double **J) const override
  {
    Matrix6d J_pose;
    Eigen::Map<Vector6d> out(r);
    out = residual(prior, S, fromBlock(x[0]), &J_pose);
    if (J && J[0])
      putPose<6, 6>(J_pose, J[0]);
    return true;
  }
};
struct OdometryCost : ceres::SizedCostFunction<6, 12, 12>
{
  Odometry odometry;
  Matrix6d S;
  bool Evaluate(double const *const *x, double *r, double **J) const override
  {
    Matrix6d J_a, J_b;
    Eigen::Map<Vector6d> out(r);
    out = residual(odometry, S, fromBlock(x[0]), fromBlock(x[1]), &J_a, &J_b);
    if (J && J[0])
      putPose<6, 6>(J_a, J[0]);
    if (J && J[1])
      putPose<6, 6>(J_b, J[1]);
    return true;
  }
};
struct ViewCost : ceres::SizedCostFunction<4, 12, 5>
{
  SquareRootSummary root;
  Pose bMc;
  bool Evaluate(double const *const *x, double *r, double **J) const override
  {
    Matrix46d J_pose;
    Matrix45d J_trunk;
    Eigen::Map<Vector4d> out(r);
    out = residual(root, bMc, fromBlock(x[0]), trunkFrom(x[1]), &J_pose, &J_trunk);
    if (J && J[0])
      putPose<4, 6>(J_pose, J[0]);
    if (J && J[1])
      Eigen::Map<Eigen::Matrix<double, 4, 5, Eigen::RowMajor>>{J[1]} = J_trunk;
    return true;
  }
};
struct TrunkCost : ceres::SizedCostFunction<5, 5>
{
  TrunkPrior prior;
  bool Evaluate(double const *const *x, double *r, double **J) const override
  {
    Eigen::Map<Vector5d> out(r);
    out = residual(prior, trunkFrom(x[0]));
    if (J && J[0]) {
      Eigen::Map<Eigen::Matrix<double, 5, 5, Eigen::RowMajor>> M(J[0]);
      M = Matrix5d(prior.sigma.cwiseInverse().asDiagonal());
    }
    return true;
  }
};

/// Solves \p graph from its values; returns the cost and the ms of the solve alone (not of building
/// it).
std::pair<double, double> solveByCeres(const Graph &graph, double tolerance)
{
  std::vector<PoseBlock> poses;
  std::vector<std::array<double, 5>> trunks;
  for (const auto &v : graph.poses)
    poses.push_back(toBlock(v.wMb));
  for (const auto &v : graph.trunks)
    trunks.push_back({v.trunk.xy.x(), v.trunk.xy.y(), v.trunk.log_radius, v.trunk.lean.x(), v.trunk.lean.y()});
  ceres::Problem problem;
  for (PoseBlock &block : poses)
    problem.AddParameterBlock(block.data(), 12, new PoseManifold);
  for (const auto &e : graph.pose_priors) {
    auto *c = new PriorCost;
    c->prior = e.prior;
    c->S = squareRootInformation<6>(e.prior.covariance, "covariance");
    problem.AddResidualBlock(c, nullptr, poses[e.pose].data());
  }
  for (const auto &e : graph.odometry) {
    auto *c = new OdometryCost;
    c->odometry = e.odometry;
    c->S = squareRootInformation<6>(e.odometry.covariance, "covariance");
    problem.AddResidualBlock(c, nullptr, poses[e.a].data(), poses[e.b].data());
  }
  for (const auto &e : graph.observations) {
    auto *c = new ViewCost;
    squareRoot(e.summary, c->root);
    c->bMc = graph.bMc;
    ceres::LossFunction *loss = nullptr;
    if (graph.summary_loss.kind == LossKind::huber)
      loss = new ceres::HuberLoss(graph.summary_loss.width);
    else if (graph.summary_loss.kind == LossKind::cauchy)
      loss = new ceres::CauchyLoss(graph.summary_loss.width);
    problem.AddResidualBlock(c, loss, poses[e.pose].data(), trunks[e.trunk].data());
  }
  for (std::size_t j = 0; j < trunks.size(); ++j) {
    auto *c = new TrunkCost;
    c->prior = graph.trunks[j].prior;
    problem.AddResidualBlock(c, nullptr, trunks[j].data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.num_threads = 1;
  options.max_num_iterations = 200;
  options.function_tolerance = tolerance;
  options.gradient_tolerance = options.parameter_tolerance = 1e-14;
  ceres::Solver::Summary summary;
  const double start = threadMs();
  ceres::Solve(options, &problem, &summary);
  return {summary.final_cost, threadMs() - start};
}
} // namespace

int main(int argc, char **argv)
{
  const int most = argc > 1 ? std::atoi(argv[1]) : 2000;
  for (int poses : {100, 500, most}) {
    test::FlightOptions o;
    o.poses = poses;
    const test::Flight flight = test::simulateFlight(o);
    test::Replay replay(flight, test::smootherFor(o));
    std::vector<double> ms;
    while (replay.next < poses) {
      replay.add();
      const double start = threadMs();
      replay.smoother.update();
      ms.push_back(threadMs() - start);
    }
    std::vector<double> last(ms.end() - std::min<long>(200, poses / 2), ms.end());
    std::sort(last.begin(), last.end());
    const Graph graph = replay.smoother.graph();
    const auto [resolved, resolve_ms] = solveByCeres(graph, 1e-6);
    const auto [optimum, ignored] = solveByCeres(graph, 1e-14);
    replay.smoother.optimize(1e-12);
    const double ours = replay.smoother.cost(), median = last[last.size() / 2];
    fmt::print("{:5d} poses: optimum ours {:.9g}, Ceres {:.9g}, relative {:+.1e}; update median "
               "{:.3f} ms, Ceres re-solve from "
               "our estimate to 1e-6 {:.1f} ms: {:.0f} times\n",
               poses, ours, optimum, (ours - optimum) / optimum, median, resolve_ms, resolve_ms / median);
  }
}
