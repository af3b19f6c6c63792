// SPDX-License-Identifier: GPL-2.0-or-later
// The same graphs by Ceres: same optimum? And one incremental update against one re-solve.
// benchmark_smoothing_ceres [poses | graph.g2o ...]; without one, also graphs as many public ones are: as many poses
// and edges as manhattan, INTEL, the parking garage and the sphere have, as SE(3).
#include "smoothing/factors.h"
#include "support/flight.h"

#include <ceres/ceres.h>
#include <ctime>
#include <fmt/core.h>
#include <map>
#include <random>
#include <tuple>

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
struct DirectionCost : ceres::SizedCostFunction<5, 12, 12>
{
  RelativePoseMeasurement measured;
  Matrix5d S;
  Pose bMc;
  bool Evaluate(double const *const *x, double *r, double **J) const override
  {
    Matrix56d J_a, J_b;
    Eigen::Map<Vector5d> out(r);
    out = residual(measured, S, bMc, fromBlock(x[0]), fromBlock(x[1]), &J_a, &J_b);
    if (J && J[0])
      putPose<5, 6>(J_a, J[0]);
    if (J && J[1])
      putPose<5, 6>(J_b, J[1]);
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
  const auto lossOf = [](const Loss &loss) -> ceres::LossFunction * {
    return loss.kind == LossKind::huber    ? static_cast<ceres::LossFunction *>(new ceres::HuberLoss(loss.width))
           : loss.kind == LossKind::cauchy ? static_cast<ceres::LossFunction *>(new ceres::CauchyLoss(loss.width))
                                           : nullptr;
  };
  for (const auto &e : graph.relative_poses) {
    auto *c = new DirectionCost;
    c->measured = e.measurement;
    c->S = squareRootInformation(e.measurement);
    c->bMc = graph.bMc;
    problem.AddResidualBlock(c, lossOf(graph.direction_loss), poses[e.a].data(), poses[e.b].data());
  }
  for (const auto &e : graph.observations) {
    auto *c = new ViewCost;
    squareRoot(e.summary, c->root);
    c->bMc = graph.bMc;
    problem.AddResidualBlock(c, lossOf(graph.summary_loss), poses[e.pose].data(), trunks[e.trunk].data());
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

/// From the values of \p graph to the optimum by both.
void compare(const std::string &name, const Graph &graph)
{
  const auto [theirs, theirs_ms] = solveByCeres(graph, 1e-10);
  Smoother smoother(graph, SmootherOptions());
  const double start = threadMs();
  const UpdateResult result = smoother.optimize(1e-10);
  fmt::print("{}: {} poses, {} trunks, {} edges: cost {:.6g}; ours {:.9g} in {:.2f} s ({} iterations, with all "
             "covariances), Ceres {:.9g} in {:.2f} s: relative {:+.1e}\n",
             name, graph.poses.size(), graph.trunks.size(),
             graph.odometry.size() + graph.relative_poses.size() + graph.observations.size(), cost(graph),
             smoother.cost(), (threadMs() - start) / 1e3, result.iterations, theirs, theirs_ms / 1e3,
             (smoother.cost() - theirs) / theirs);
  std::fflush(stdout);
}

/// A graph of poses: steps from one to the next and \p loops, measured with noise, and the path by the steps alone.
Graph poseGraph(const std::vector<Pose> &truth, const std::vector<std::pair<int, int>> &loops, double metres,
                double radians, std::mt19937 &random)
{
  std::normal_distribution<double> normal;
  Graph graph;
  graph.pose_priors.push_back({0, {truth[0], 1e-6 * Matrix6d::Identity()}});
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(metres), Eigen::Vector3d::Constant(radians);
  const auto measure = [&](std::size_t a, std::size_t b) {
    Vector6d noise;
    for (int k = 0; k < 6; ++k)
      noise(k) = sigma(k) * normal(random);
    graph.odometry.push_back(
        {a, b, {(truth[a].inverse() * truth[b]).plus(noise), Matrix6d(sigma.cwiseAbs2().asDiagonal())}});
  };
  graph.poses.push_back({0, truth[0]});
  for (std::size_t i = 1; i < truth.size(); ++i) {
    measure(i - 1, i);
    graph.poses.push_back({static_cast<std::int64_t>(i), graph.poses.back().wMb * graph.odometry.back().odometry.aMb});
  }
  for (const auto &[a, b] : loops)
    measure(static_cast<std::size_t>(a), static_cast<std::size_t>(b));
  return graph;
}

Pose poseAt(double x, double y, double z, double yaw)
{
  return {Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix(), {x, y, z}};
}

std::vector<std::pair<int, int>> someOf(std::vector<std::pair<int, int>> all, int count, std::mt19937 &random)
{
  std::shuffle(all.begin(), all.end(), random);
  all.resize(std::min(all.size(), static_cast<std::size_t>(count)));
  return all;
}

/// Streets of a block, walked at random; who comes to a crossing again measures some of those there before.
Graph manhattan(int poses, int edges, std::mt19937 &random)
{
  constexpr int kHalf = 16;
  std::uniform_real_distribution<double> uniform;
  std::vector<Pose> truth;
  std::map<std::pair<int, int>, std::vector<int>> there;
  std::vector<std::pair<int, int>> met;
  int x = 0, y = 0, heading = 0;
  for (int i = 0; i < poses; ++i) {
    truth.push_back(poseAt(x, y, 0, heading * M_PI / 2));
    for (const int before : there[{x, y}])
      met.emplace_back(before, i);
    there[{x, y}].push_back(i);
    if (uniform(random) < 0.2)
      heading += uniform(random) < 0.5 ? 1 : 3;
    const auto next = [&] {
      constexpr int kX[] = {1, 0, -1, 0}, kY[] = {0, 1, 0, -1};
      return std::pair{x + kX[heading % 4], y + kY[heading % 4]};
    };
    while (std::max(std::abs(next().first), std::abs(next().second)) > kHalf)
      ++heading;
    std::tie(x, y) = next();
  }
  return poseGraph(truth, someOf(met, edges - poses + 1, random), 0.02, 0.01, random);
}

/// Rounds of \p lap poses, each \p rise higher, which measure the rounds before.
Graph rounds(int poses, int edges, int lap, double radius, double rise, std::mt19937 &random)
{
  std::vector<Pose> truth;
  std::vector<std::pair<int, int>> met;
  for (int i = 0; i < poses; ++i) {
    const double angle = 2 * M_PI * i / lap;
    truth.push_back(poseAt(radius * std::sin(angle), -radius * std::cos(angle), rise * i / lap, angle));
    for (int round = 1; round <= 3; ++round)
      for (int beside = -2; beside <= 2; ++beside)
        if (const int other = i - round * lap + beside; other >= 0)
          met.emplace_back(other, i);
  }
  return poseGraph(truth, someOf(met, edges - poses + 1, random), 0.03, 0.005, random);
}

/// Rings of \p ring poses, each of which measures the one below it.
Graph sphere(int poses, int ring, std::mt19937 &random)
{
  std::vector<Pose> truth;
  std::vector<std::pair<int, int>> below;
  for (int i = 0; i < poses; ++i) {
    const double up = M_PI * ((i + 0.5) / poses - 0.5), round = 2 * M_PI * i / ring;
    const Eigen::Vector3d out(std::cos(up) * std::cos(round), std::cos(up) * std::sin(round), std::sin(up)),
        along(-std::sin(round), std::cos(round), 0);
    Pose pose;
    pose.R << along, out.cross(along), out;
    pose.t = 50 * out;
    truth.push_back(pose);
    if (i >= ring)
      below.emplace_back(i - ring, i);
  }
  return poseGraph(truth, below, 0.1, 0.02, random);
}
} // namespace

int main(int argc, char **argv)
{
  const bool has_files = argc > 1 && std::string(argv[1]).find(".g2o") != std::string::npos;
  for (int i = 1; has_files && i < argc; ++i)
    compare(argv[i], readG2o(argv[i]));
  if (has_files)
    return 0;
  std::mt19937 random(1);
  if (argc == 1) {
    compare("manhattan", manhattan(3500, 5598, random));
    compare("INTEL", rounds(1228, 1483, 300, 12, 0, random));
    compare("garage", rounds(1661, 6275, 330, 25, 3, random));
    compare("sphere", sphere(2500, 50, random));
  }
  const int most = argc > 1 ? std::atoi(argv[1]) : 2000;
  for (int poses : {100, 500, most}) {
    test::FlightOptions o{poses};
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
