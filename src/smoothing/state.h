// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a Smoother holds: variables, factors, their linearisation, and the elimination tree.
///
/// Normal equations H delta = g in lower Cholesky form, H = L L^T in the order of elimination.
/// Eliminating variable v from its front [v, separator(v)] leaves the columns of L that belong to
/// v, y_v = L_vv^-1 g_v, and a contribution (Schur complement and right-hand side on the separator)
/// that the parent, the first eliminated of the separator, takes into its own front. Every
/// separator lies on the path from its node to the root.

#include "smoothing/factors.h"

#include <bole/smoother.h>

#include <array>
#include <deque>
#include <memory>

namespace bole
{
enum class Life : unsigned char
{
  open,
  closed,
  removed
};

struct Variable
{
  bool is_pose = true;
  Life life = Life::open;
  bool in_moved = false;
  int number = 0; ///< of the pose or trunk
  int dim = 6;
  std::vector<int> factors;
  Vector6d delta = Vector6d::Zero();  ///< estimate = linearisation point (+) delta
  Vector6d probed = Vector6d::Zero(); ///< the delta at which the linearisation was last found good
  Eigen::Vector3d probed_displacement = Eigen::Vector3d::Zero(); ///< against the parent, then
  int affected = 0;                                              ///< stamp
  unsigned visited = 0;                                          ///< the back-substitution that last came by

  // node of the elimination tree
  bool eliminated = false;
  bool has_contribution = false;
  int parent = -1;
  int separator_dim = 0;
  std::int64_t order = -1;
  std::vector<int> children, separator, assembled;
  std::vector<double> columns;      ///< (dim + separator_dim) x dim, column-major: L_vv over L_sv
  std::vector<float> old_columns;   ///< in their place where the variable is old: half the memory to read and to keep
  std::vector<double> contribution; ///< packed lower triangle on the separator, then its right-hand side
  std::array<double, 6> y{};
  double share = 0; ///< of the cost of the linearised graph
};

enum class FactorKind : unsigned char
{
  pose_prior,
  odometry,
  relative_pose,
  observation,
  marginal
};

struct Factor
{
  FactorKind kind = FactorKind::pose_prior;
  bool alive = true;
  bool stale = true;                ///< linearise before the next elimination
  int data = 0;                     ///< index among the data of its kind
  int a = -1, b = -1;               ///< variables (marginal: see its data)
  int assembled_at = -1;            ///< variable whose front takes it in
  std::unique_ptr<double[]> linear; ///< rows x (dim a + dim b + 1), column-major: whitened Jacobians, minus residual;
                                    ///< old: none
  double cost = 0;                  ///< rho / 2 at the point of linearisation
};

/// Rows of the whitened residual (not of a marginal).
int rowCount(FactorKind kind);
/// Doubles of its linearisation (not of a marginal).
std::size_t blockSize(FactorKind kind);

/// The prior that marginalised variables leave: a quadratic in the tangents at the points where it was made.
struct MarginalData
{
  std::vector<int> variables;
  std::vector<Pose> poses;   ///< points, for the variables that are poses
  std::vector<Trunk> trunks; ///< points, for those that are trunks
  Eigen::MatrixXd H;
  Eigen::VectorXd g_there, g; ///< at those points, at the present points of linearisation
};

struct PoseState
{
  Pose point;        ///< of linearisation; the last estimate once closed
  int variable = -1; ///< -1: closed
};
struct TrunkState
{
  Trunk point;
  TrunkPrior prior;
  int variable = -1;                ///< -1: closed
  Vector5d kept = Vector5d::Zero(); ///< delta when the point was chosen: the common shift of its neighbours
  int last_pose = 0;                ///< that saw it
  int behind = 0;                   ///< where it is kept: the pose that it is eliminated behind, at the earliest
  int observations = 0;
  bool removed = false;
  bool is_kept = false; ///< open whenever it was seen last
  Matrix5d marginalised_covariance = Matrix5d::Zero();
  Eigen::Matrix2d marginalised_place_covariance = Eigen::Matrix2d::Zero();
};

/// Poses between two whose covariance is taken on closing: it is a walk through the whole lag, and changes slowly.
constexpr int kCovarianceEvery = 16;

/// The axis moved without a turn.
Trunk shifted(Trunk trunk, const Eigen::Vector3d &shift);

class Smoother::State
{
public:
  SmootherOptions options;
  std::deque<Variable> variables;
  std::deque<PoseState> poses;
  std::deque<TrunkState> trunks;
  std::vector<Matrix6d> marginalised_covariances; ///< of every kCovarianceEvery-th closed pose
  std::deque<Factor> factors;
  std::deque<PosePrior> pose_priors;
  std::deque<Odometry> odometry;
  std::deque<RelativePoseMeasurement> relative_poses;
  std::deque<SquareRootSummary> observations;
  std::deque<MarginalData> marginals;
  std::size_t live_observations = 0;

  // build.cpp
  Eigen::Vector3d shiftOfPoint(int pose) const;
  std::size_t newPose(const Pose &point);
  std::size_t newTrunk(const Trunk &point, const TrunkPrior &prior);
  void reopenTrunk(int trunk);
  int newFactor(FactorKind kind, int data, int a, int b);
  int placeFactor(Factor factor);
  template <typename Data> int placeData(std::deque<Data> &list, FactorKind kind, Data data);
  void dropFactor(int factor);
  void freeDropped();
  void addOdometryFactor(int a, int b, const Odometry &measured);
  void openTrunkFor(int pose, int trunk);
  void addObservationFactor(int pose, int trunk, const SquareRootSummary &summary);
  void removeTrunk(int trunk);
  void mergeTrunks(int keep, int gone);
  void checkPose(std::size_t pose) const;
  void checkTrunk(std::size_t trunk) const;
  bool isOpen(int variable) const { return variable >= 0 && variables[variable].life == Life::open; }
  int placeVariable(Variable variable);
  void recycle(int variable);

  // linearise.cpp
  void linearise(Factor &factor);
  double costAtEstimate(const Factor &factor) const;
  double costAtEstimate() const;
  void relinearise(int variable, const Eigen::Vector3d &shift = Eigen::Vector3d::Zero());
  void touchNeighbours(int variable);
  Eigen::Vector3d displacement(const Variable &variable) const;
  Eigen::Vector3d ownDisplacement(const Variable &variable) const;
  Vector6d ownStep(const Variable &variable) const;
  void rememberProbe(Variable &variable) const;
  bool needsRelinearisation(Variable &variable);
  double inThresholds(const Variable &variable, const Vector6d &step) const;
  bool isInside(const Variable &variable) const;
  double linearisationError(Factor &factor);
  Vector6d linearPrediction(Factor &factor);
  Pose estimate(const PoseState &pose) const;
  Trunk estimate(const TrunkState &trunk) const;
  Vector5d limitedTrunkStep(const TrunkState &trunk, const Vector5d &delta) const;

  // elimination.cpp
  void eliminate(int variable);
  void assemble(Factor &factor);
  void assembleChild(const Variable &child);
  double staleness(const Variable &variable, double *rhs);
  void solve(Variable &variable, double *rhs);

  // update.cpp
  UpdateResult update();
  void touch(int variable);
  void markAncestors();
  void addMissingContributions();
  void reeliminate(UpdateResult &result);
  void backSubstitute(UpdateResult &result);
  int passDepth();
  struct Descent
  {
    int variable, below, quiet; ///< how much deeper to go; variables in a row above it that were near their solution
  };
  void visitBelow(std::vector<Descent> &open, int &visits, UpdateResult &result);
  void fetchAhead(int pose) const;
  void pushChildren(std::vector<Descent> &open, int id, int below, int quiet) const;
  void resolveIfStale(Variable &v, int id, double *rhs, UpdateResult &result);
  int movableAge() const;
  int reachBack(const Variable &variable) const;
  void moveLinearisation(UpdateResult &result);
  Eigen::Vector3d shiftBeyondAffected() const;
  void compressOld(Variable &v);

  // lag.cpp
  void marginaliseBehindLag();
  void marginaliseVariable(int variable);
  void reorderKept();

  // optimize.cpp
  void measureDampingScale();
  void relineariseAll();
  void solveAll(UpdateResult &result);
  UpdateResult optimize(double tolerance, int max_iterations);

  // ordering.cpp
  void orderAffected();

  // covariance.cpp
  /// y = L^-1 X^T with X zero but for the columns of the variables given; returns y^T y.
  template <int Columns>
  Eigen::Matrix<double, Columns, Columns> inverseForm(const int *variable, const Eigen::Matrix<double, Columns, 6> *X,
                                                      int count);
  Matrix5d trunkCovariance(int trunk);
  Eigen::Matrix2d placeCovariance(int trunk);
  Matrix6d poseCovariance(int pose);
  template <int Columns>
  Eigen::Matrix<double, Columns, Columns> relativeCovariance(int trunk, const Eigen::Matrix<double, Columns, 4> &which);
  Matrix4d relativeCovariance(int trunk);
  double bearingVariance(int trunk);

  // export.cpp
  Graph graph() const;
  std::size_t memoryBytes() const;

  // work space
  bool is_optimizing = false; ///< the batch optimum is wanted to the last digit
  double damping = 0;         ///< Levenberg's, added to the diagonal scaled by damping_scale
  std::vector<Vector6d> damping_scale;
  double constant_cost = 0;
  std::vector<int> dropped_factors, removed_variables; ///< still named by what is to be eliminated again
  std::vector<int> free_factors, free_variables;
  std::vector<int> free_trunks;              ///< under a lag, which has no end
  std::array<std::vector<int>, 6> free_data; ///< by kind of factor
  std::vector<int> touched, affected, moved, stale_factors, pool, orphans;
  std::vector<Descent> descents, postponed; ///< of the present back-substitution, and what those before left
  std::vector<double> front, separator_delta;
  std::vector<int> position, child_map; ///< of a variable in the front
  std::vector<int> child_run;           ///< where the rows end that stand together in the front
  std::vector<std::array<double, 36>> path_rows;
  std::vector<int> path;
  std::vector<int> open_trunks; ///< variables, for the lag
  int front_rows = 0;           ///< columns of the front plus the row of the right-hand side
  int stamp = 0;
  unsigned passes = 0; ///< back-substitutions so far
  int held_directions = 0;
  std::int64_t next_order = 0;
  int oldest_open_pose = 0;
};

/// What \p use makes of the columns of L that belong to \p v.
template <typename Use> auto withColumns(const Variable &v, Use &&use)
{
  return v.old_columns.empty() ? use(v.columns.data()) : use(v.old_columns.data());
}

/// Stores data of a factor where some was freed, or at the end.
template <typename Data> int Smoother::State::placeData(std::deque<Data> &list, FactorKind kind, Data data)
{
  std::vector<int> &free = free_data[static_cast<std::size_t>(kind)];
  if (free.empty()) {
    list.push_back(std::move(data));
    return static_cast<int>(list.size()) - 1;
  }
  const int at = free.back();
  free.pop_back();
  list[at] = std::move(data);
  return at;
}
} // namespace bole
