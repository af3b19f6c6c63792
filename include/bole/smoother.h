// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The smoother: all poses and all trunks from odometry and summary factors (paper, Section 4, Eq.
/// 2), at a cost a frame that does not grow with the flight.
///
/// Idea: two parts over one elimination of sparse normal equations (multifrontal Cholesky). In flight, update()
/// optimises a window: the newest poses, the trunks that they see, and those seen last before. What leaves the window
/// becomes a quadratic on what stays (Schur complement), linearised there and then; whatever it touches has its
/// Jacobians at the same point from then on (first estimates). For the whole, optimize() is Levenberg-Marquardt on all
/// factors, in an order of little fill; it also runs where something changes that left the window: two visits of a
/// trunk are tied, or one is given up.
///
/// Frames: poses wMb, camera at wMb * bMc. Tangents (and the rows of covariances): Pose (rho [m],
/// phi [rad]), Trunk (x [m], y [m], log r, lean x, lean y), RelativeTrunk (phi_x, phi_y, phi_z
/// [rad], d log s).
///
/// Every trunk has a prior on all five numbers, weak on x and y: a trunk seen once, or through a
/// rank-deficient F, stays on it, and its covariance says so. Errors of the caller (a covariance
/// that is none, an unknown id) throw vpException(badValue); an F that is no minimum is an expected
/// outcome and returns a status. One object is for one thread at a time; const functions use its
/// work space too.
///
/// Cost: update() some milliseconds at most, whatever the length of the flight, see the benchmark smoothing_flat; of
/// the whole, O(length of the flight) an iteration where it does not return, more where it closes many loops.
/// Limit: a trunk that is not among those seen last is not in the window; where it is seen again all the same, the
/// whole is solved, or, where what left the window is forgotten, nothing but its radius and lean is known of it.
///
/// Deviations from the paper: trunks may lean; robust loss on summary factors; the paper sums
/// energies, we drop the part of them that no variable can change.
///
/// \code
/// bole::Smoother smoother;                                        // default options
/// std::size_t pose = smoother.addFirstPose(bole::Pose(), 1e-6 * bole::Matrix6d::Identity());
/// std::size_t trunk = smoother.addTrunk(bole::trunkFromRelative(wMc, summary.optimum, 0.15));
/// smoother.addObservation(pose, trunk, summary);
/// pose = smoother.addPose(aMb, covariance);                       // odometry since the pose before
/// smoother.addObservation(pose, trunk, next_summary);
/// smoother.update();
/// bole::Pose wMb = smoother.pose(pose);
/// \endcode

#include <bole/graph.h>

#include <memory>

namespace bole
{
/// How the smoother iterates and what it forgets.
struct SmootherOptions
{
  /// Camera in the body frame. Default: forward-looking (z of the camera along x of the body).
  Pose bMc = forwardCamera();

  /// Gauss-Newton iterations in one update(), >= 1. Default: the next frame goes on with
  /// what has not settled.
  int max_iterations = 2;

  /// Robust loss on summary factors. Default: a wrongly associated view pulls with a bounded force;
  /// Cauchy forgets it altogether, but has local optima in which long flights were caught.
  Loss summary_loss = {LossKind::huber, 3.0};
  /// Robust loss on relative poses from points: their covariance does not know of moving branches.
  Loss direction_loss = {LossKind::huber, 4.0};

  // Priors of a new trunk; addTrunk() has a variant with its own.
  double prior_radius = 0.15;          ///< [m], median of the log-normal prior, > 0: forest trunks, 0.08 to 0.3
  double prior_log_radius_sigma = 0.5; ///< > 0: a factor of 1.6 at one sigma
  double prior_lean_sigma = 0.035;     ///< tan, > 0: 2 degrees; 1e-4 switches lean off
  double prior_position_sigma = 50;    ///< [m], > 0: about the first guess; only keeps unseen trunks somewhere

  /// The window: poses that are optimised in each update, >= 2. Older ones keep their estimate. Default: four seconds
  /// of ten frames each, in which a trunk that is passed is seen from a few metres apart.
  int window = 40;
  /// Trunks out of sight that the window remembers, those seen last, >= 0: they tie the visits of a place together.
  /// Each costs 5 columns of a dense quadratic, so tens.
  int remembered = 24;
  /// Whether nothing is kept of what left the window but the prior that it became: memory is then a pose a frame
  /// (96 bytes), and there is no whole.
  bool forgets = false;

  /// Camera that looks along the body's x axis, without a lever arm.
  static Pose forwardCamera();
  /// Throws vpException(badValue) "name = value, must be ...".
  void validate() const;
};

/// How an update went.
enum class UpdateStatus
{
  ok,              ///< settled: a further step would not matter
  iteration_limit, ///< still moving after max_iterations; the next update() goes on
  degenerate       ///< a direction of some variable had no information beyond rounding and was held
};
/// As reports write it.
const char *toString(UpdateStatus status);

/// What an update did.
struct UpdateResult
{
  UpdateStatus status = UpdateStatus::ok; ///< ok, or why not
  int iterations = 0;                     ///< Gauss-Newton steps taken
  double cost = 0;                        ///< of update(): of the window with its prior; of optimize(): of the whole
};

/// Poses and trunks from odometry, point features and summary factors (Eq. 2), solved in flight and as a whole.
class Smoother
{
public:
  /// An empty problem.
  explicit Smoother(const SmootherOptions &options = SmootherOptions());
  /// All of \p graph (validated; its bMc and losses replace those of \p options). Pose i and trunk
  /// j are graph.poses[i] and graph.trunks[j]. Not settled yet: call update() or optimize().
  Smoother(const Graph &graph, const SmootherOptions &options);
  ~Smoother();
  /// Moves the problem.
  Smoother(Smoother &&) noexcept;
  Smoother &operator=(Smoother &&) noexcept; ///< Moves the problem.

  /// As given to the constructor.
  const SmootherOptions &options() const;

  // Growing the graph. Ids count from 0; where the window forgets, that of a removed trunk is given again.

  /// The pose that all others hang on. \return 0
  std::size_t addFirstPose(const Pose &wMb, const Matrix6d &covariance);
  /// Next pose, \p aMb in the frame of the pose before, with the odometry factor between them.
  std::size_t addPose(const Pose &aMb, const Matrix6d &covariance);
  /// A pose \p aMb after the last one [m, rad], with its covariance in the step's own frame. \return its index
  std::size_t addPose(const Pose &aMb, const Matrix6d &covariance, const Pose &wMb_guess);
  /// A trunk without prior. \return its index
  std::size_t addTrunk(const Trunk &guess);
  /// A trunk with a prior on its radius and lean. \return its index
  std::size_t addTrunk(const Trunk &guess, const TrunkPrior &prior);
  /// Indefinite or non-finite summaries are not added. The energy's constant part is not kept.
  SummaryStatus addObservation(std::size_t pose, std::size_t trunk, const SummaryFactor &summary);
  /// Not added where one of the poses was forgotten.
  void addRelativePose(std::size_t a, std::size_t b, const RelativePoseMeasurement &measurement);
  /// Odometry between any two poses, e.g. a loop closed by other means. Not added where one was forgotten.
  void addOdometry(std::size_t a, std::size_t b, const Odometry &odometry);
  /// An absolute measurement of a pose.
  void addPosePrior(std::size_t pose, const PosePrior &prior);

  /// Forgets a trunk and all that was seen of it.
  void removeTrunk(std::size_t trunk);
  /// What was seen of \p gone was \p keep all along; \p gone is forgotten, its prior too.
  void mergeTrunks(std::size_t keep, std::size_t gone);
  /// Whether what leaves the window says something of this trunk (default), or its views are left out of the prior, as
  /// for a hypothesis that may be given up: then that is as if they had never been.
  void keepTrunk(std::size_t trunk, bool is_kept);

  // Solving.

  /// Takes in what was added or removed since: a few iterations on the window.
  UpdateResult update();
  /// The optimum of the whole graph: Levenberg-Marquardt with everything linearised anew, until the
  /// cost falls by less than \p tolerance (relative). It never rises, and nothing ever leaves the finite numbers.
  /// Where the window forgets, the optimum of the window.
  UpdateResult optimize(double tolerance = 1e-9, int max_iterations = 100);

  // Estimates, as of the last update().

  /// Estimate of a pose, world from body.
  Pose pose(std::size_t pose) const;
  /// Estimate of a trunk, in the world.
  Trunk trunk(std::size_t trunk) const;
  /// Poses added so far, forgotten ones included.
  std::size_t poseCount() const;
  std::size_t observationCount() const; ///< summary factors in the graph
  /// Views of a trunk.
  std::size_t observationCount(std::size_t trunk) const;
  /// Exact cost of the graph at the estimates, as cost(graph()); where the window forgets, of the window. O(graph).
  double cost() const;

  // Marginal covariances of the linearised window as of the last update(): that of what was not yet
  // taken in is not known. For what is not in the window: as of when it left or of the last optimize().

  /// Marginal covariance in the units of Trunk::minus [m, m, -, -, -].
  Matrix5d trunkCovariance(std::size_t trunk) const;
  /// That of a trunk's place as the last pose that saw it has it [m^2]: along the axes of the world, without what both
  /// have drifted by since the first pose.
  Eigen::Matrix2d placeCovariance(std::size_t trunk) const;
  /// Marginal covariance of a pose, in its own frame, in the order of Pose::plus [m, rad].
  Matrix6d poseCovariance(std::size_t pose) const;
  /// The same of the last pose, cheaper.
  Matrix6d currentPoseCovariance() const;
  /// The relative trunk that the newest pose should see.
  RelativeTrunk predictedRelative(std::size_t trunk) const;
  /// Its covariance, from the joint marginal of the newest pose and the trunk.
  Matrix4d relativeCovariance(std::size_t trunk) const;
  /// Of its bearing alone, its element (2, 2), cheaper.
  double bearingVariance(std::size_t trunk) const;

  /// All that is held, at the estimates. Removed trunks are left out; ids: pose i is i, trunk j is
  /// poseCount() + j.
  Graph graph() const;

private:
  class State;
  std::unique_ptr<State> m_state;
};
} // namespace bole
