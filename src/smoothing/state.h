// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a Smoother holds: poses, trunks, the factors between them, and the prior that stands for what left the window.

#include "smoothing/factors.h"
#include "smoothing/normal_equations.h"

#include <bole/smoother.h>

#include <deque>
#include <optional>

namespace bole
{
struct StepFactor
{
  std::size_t a, b;
  Odometry measured;
  Matrix6d S; ///< square root information
};
struct DirectionFactor
{
  std::size_t a, b;
  RelativePoseMeasurement measured;
  Matrix5d S;
};
struct AbsoluteFactor
{
  PosePrior measured;
  Matrix6d S;
};
struct ViewFactor
{
  std::size_t trunk;
  SquareRootSummary seen;
};
/// All factors whose first pose it is.
struct FactorsOfPose
{
  std::vector<AbsoluteFactor> absolutes;
  std::vector<StepFactor> steps;
  std::vector<DirectionFactor> directions;
  std::vector<ViewFactor> views;
};

struct TrunkState
{
  Trunk value;
  TrunkPrior prior;
  std::vector<std::size_t> seen;                              ///< the poses whose view of it is held, rising
  Matrix5d covariance = Matrix5d::Zero();                     ///< as of when it was last known
  Eigen::Matrix2d place_covariance = Eigen::Matrix2d::Zero(); ///< the same, of its place as the last pose saw it
  std::optional<Trunk> point;                                 ///< the prior touches it: where it is linearised
  std::size_t last_seen = 0;
  bool is_removed = false, is_kept = true;
  bool is_free = false;     ///< its number is given again
  bool is_absorbed = false; ///< with its own prior: it left the window and was forgotten
};

/// A pose or a trunk.
struct Name
{
  bool is_pose;
  std::size_t number;
};

/// What left the window says of what stayed: a quadratic about the points at which it was linearised.
struct WindowPrior
{
  std::vector<Name> names;
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
};

/// Which variable each pose and trunk is in a system; -1: none.
struct Places
{
  std::size_t first_pose = 0;
  std::vector<int> pose, trunk; ///< pose: from first_pose on
  std::vector<Name> names;
  std::vector<int> dims;

  /// Takes it in, if it is not yet.
  void take(const Name &name);
  int of(const Name &name) const { return name.is_pose ? pose[name.number - first_pose] : trunk[name.number]; }
};

class Smoother::State
{
public:
  SmootherOptions options;
  std::vector<Pose> poses;
  std::deque<FactorsOfPose> factors;      ///< of the poses from first_held on
  std::size_t first_held = 0;             ///< later than 0 where what left the window is forgotten
  std::size_t first_open = 0;             ///< of the window
  std::deque<std::optional<Pose>> points; ///< of the poses from first_open on: where those are linearised that the
                                          ///< prior touches
  std::vector<TrunkState> trunks;
  std::vector<std::size_t> free_trunks; ///< where what left is forgotten: a flight has no end
  WindowPrior prior;
  bool is_whole_due = false;              ///< something changed before the window
  std::vector<Matrix6d> pose_covariances; ///< as of the last optimize()
  std::optional<NormalEquations> window;  ///< as of the last update()
  Places window_places;

  // smoother.cpp
  void checkPose(std::size_t pose) const;
  void checkTrunk(std::size_t trunk) const;
  FactorsOfPose &factorsOf(std::size_t pose) { return factors[pose - first_held]; }
  const FactorsOfPose &factorsOf(std::size_t pose) const { return factors[pose - first_held]; }
  bool isHeld(std::size_t pose) const { return pose >= first_held; }
  std::size_t newPose(const Pose &wMb);
  std::size_t newTrunk(const Trunk &guess, const TrunkPrior &trunk_prior);
  void noteView(std::size_t pose, std::size_t trunk);
  void removeTrunk(std::size_t trunk);
  void mergeTrunks(std::size_t keep, std::size_t gone);
  void mergeInPrior(std::size_t keep, std::size_t gone);

  // linearise.cpp
  class Adder;
  bool isTouched(const Name &name) const; ///< by the prior of the window
  const Pose &pointOf(std::size_t pose) const;
  const Trunk &pointOf(const TrunkState &trunk) const;
  Eigen::VectorXd offsetOf(const Name &name) const; ///< of the value from the point
  /// Adds the factors of \p pose to \p system, where there is one, and returns what they cost at the present values.
  /// \p about_points: by the offset from the points, else by the step from the present values. \p kept_only: views of
  /// kept trunks alone.
  double add(std::size_t pose, const Places &places, NormalEquations *system, bool about_points = false,
             bool kept_only = false) const;
  double addTrunkPrior(std::size_t trunk, const Places &places, NormalEquations *system,
                       bool about_points = false) const;
  double addWindowPrior(const Places &places, NormalEquations *system, bool about_points = false) const;
  Vector5d limited(const TrunkState &trunk, const Vector5d &step, const Eigen::Vector2d &shift) const;
  void move(const Places &places, const NormalEquations &system);

  // window.cpp
  UpdateResult update();
  bool isInWindow(const TrunkState &trunk) const { return !trunk.seen.empty() && trunk.seen.back() >= first_open; }
  bool isSolved(const Name &name) const;
  void placeWindow();
  double addWindow(NormalEquations *system) const;
  double solveWindow(UpdateResult &result);
  std::vector<bool> remembered(std::size_t until) const;
  Eigen::Vector3d shiftOfPrior() const;
  void recentre();
  void absorb(std::size_t from, std::size_t until);
  void shrink();
  void forget(std::size_t until);
  Matrix5d trunkCovariance(std::size_t trunk) const;
  using FromPose = Eigen::Matrix<double, 2, 6>;
  FromPose placeJacobian(const TrunkState &trunk) const; ///< of its place as the last pose saw it, by that pose
  Eigen::Matrix2d placeCovariance(std::size_t trunk) const;
  Matrix6d poseCovariance(std::size_t pose) const;
  Eigen::MatrixXd relativeCovariance(std::size_t pose, std::size_t trunk, const Eigen::MatrixXd &which) const;

  // whole.cpp
  Places placeWhole() const;
  double addWhole(const Places &places, NormalEquations *system) const;
  void keepCovariances(const Places &places, const std::vector<int> &variables, const Eigen::MatrixXd &C);
  UpdateResult solveWhole(double tolerance, int max_iterations, bool with_covariances);
  UpdateResult optimize(double tolerance, int max_iterations);
  Graph graph() const;
};
} // namespace bole
