// SPDX-License-Identifier: GPL-2.0-or-later
// The public face: checks what the caller gives, then hands on.
#include "smoothing/state.h"

#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
void require(bool holds, const char *message)
{
  if (!holds)
    throw vpException(vpException::badValue, "%s", message);
}
} // namespace

Smoother::Smoother(const SmootherOptions &options) : m_state(std::make_unique<State>())
{
  options.validate();
  m_state->options = options;
}

Smoother::Smoother(const Graph &graph, const SmootherOptions &options) : Smoother(options)
{
  bole::validate(graph);
  State &state = *m_state;
  state.options.bMc = graph.bMc;
  state.options.summary_loss = graph.summary_loss;
  state.options.direction_loss = graph.direction_loss;
  for (const Graph::PoseVertex &vertex : graph.poses)
    state.newPose(vertex.wMb);
  for (const Graph::TrunkVertex &vertex : graph.trunks) {
    state.newTrunk(vertex.trunk, vertex.prior);
    state.trunks.back().last_pose = 0;
  }
  for (const Graph::PosePriorEdge &edge : graph.pose_priors)
    addPosePrior(edge.pose, edge.prior);
  for (const Graph::OdometryEdge &edge : graph.odometry)
    addOdometry(edge.a, edge.b, edge.odometry);
  for (const Graph::RelativePoseEdge &edge : graph.relative_poses)
    addRelativePose(edge.a, edge.b, edge.measurement);
  for (const Graph::ObservationEdge &edge : graph.observations)
    addObservation(edge.pose, edge.trunk, edge.summary);
}

Smoother::~Smoother() = default;
Smoother::Smoother(Smoother &&) noexcept = default;
Smoother &Smoother::operator=(Smoother &&) noexcept = default;

const SmootherOptions &Smoother::options() const { return m_state->options; }

std::size_t Smoother::addFirstPose(const Pose &wMb, const Matrix6d &covariance)
{
  require(m_state->poses.empty(), "addFirstPose, must come before every other pose");
  const PosePrior prior = {wMb, covariance};
  squareRootInformation<6>(covariance, "covariance of the first pose");
  const std::size_t pose = m_state->newPose(wMb);
  addPosePrior(pose, prior);
  return pose;
}

std::size_t Smoother::addPose(const Pose &aMb, const Matrix6d &covariance)
{
  require(!m_state->poses.empty(), "addPose, must follow addFirstPose");
  return addPose(aMb, covariance, m_state->estimate(m_state->poses.back()) * aMb);
}

std::size_t Smoother::addPose(const Pose &aMb, const Matrix6d &covariance, const Pose &wMb_guess)
{
  require(!m_state->poses.empty(), "addPose, must follow addFirstPose");
  require(aMb.isFinite(), "odometry, must be finite");
  squareRootInformation<6>(covariance, "odometry covariance");
  const std::size_t pose = m_state->newPose(wMb_guess);
  m_state->addOdometryFactor(static_cast<int>(pose) - 1, static_cast<int>(pose), {aMb, covariance});
  return pose;
}

std::size_t Smoother::addTrunk(const Trunk &guess)
{
  const SmootherOptions &o = m_state->options;
  TrunkPrior prior;
  prior.mean.xy = guess.xy;
  prior.mean.log_radius = std::log(o.prior_radius);
  prior.sigma << o.prior_position_sigma, o.prior_position_sigma, o.prior_log_radius_sigma, o.prior_lean_sigma,
      o.prior_lean_sigma;
  return m_state->newTrunk(guess, prior);
}

std::size_t Smoother::addTrunk(const Trunk &guess, const TrunkPrior &prior) { return m_state->newTrunk(guess, prior); }

SummaryStatus Smoother::addObservation(std::size_t pose, std::size_t trunk, const SummaryFactor &summary)
{
  m_state->checkPose(pose);
  m_state->checkTrunk(trunk);
  require(m_state->isOpen(m_state->poses[pose].variable), "pose, must be inside the lag");
  SquareRootSummary root;
  const SummaryStatus status = squareRoot(summary, root);
  if (status == SummaryStatus::ok || status == SummaryStatus::projected)
    m_state->addObservationFactor(static_cast<int>(pose), static_cast<int>(trunk), root);
  return status;
}

void Smoother::removeObservation(std::size_t pose, std::size_t trunk)
{
  m_state->checkPose(pose);
  m_state->checkTrunk(trunk);
  const int seen = m_state->trunks[trunk].variable;
  if (!m_state->isOpen(m_state->poses[pose].variable))
    return;
  const std::vector<int> factors = m_state->variables[m_state->poses[pose].variable].factors;
  for (const int id : factors) {
    const Factor &factor = m_state->factors[id];
    if (factor.kind == FactorKind::observation && factor.b == seen)
      m_state->dropFactor(id);
  }
}

void Smoother::addRelativePose(std::size_t a, std::size_t b, const RelativePoseMeasurement &measurement)
{
  m_state->checkPose(a);
  m_state->checkPose(b);
  const int variable_a = m_state->poses[a].variable, variable_b = m_state->poses[b].variable;
  require(a != b, "relative pose, must be between two poses");
  require(measurement.caRcb.allFinite() && std::abs(measurement.direction.norm() - 1) < 1e-6,
          "relative pose, must be finite with a direction of length 1");
  if (!m_state->isOpen(variable_a) || !m_state->isOpen(variable_b))
    return;
  squareRootInformation(measurement);
  const int data = m_state->placeData(m_state->relative_poses, FactorKind::relative_pose, measurement);
  m_state->newFactor(FactorKind::relative_pose, data, variable_a, variable_b);
}

void Smoother::addOdometry(std::size_t a, std::size_t b, const Odometry &odometry)
{
  m_state->checkPose(a);
  m_state->checkPose(b);
  require(a != b, "odometry, must be between two poses");
  m_state->addOdometryFactor(static_cast<int>(a), static_cast<int>(b), odometry);
}

void Smoother::addPosePrior(std::size_t pose, const PosePrior &prior)
{
  m_state->checkPose(pose);
  require(m_state->isOpen(m_state->poses[pose].variable), "pose, must be inside the lag");
  require(prior.mean.isFinite(), "pose prior, must be finite");
  squareRootInformation(prior);
  const int data = m_state->placeData(m_state->pose_priors, FactorKind::pose_prior, prior);
  m_state->newFactor(FactorKind::pose_prior, data, m_state->poses[pose].variable, -1);
}

void Smoother::removeTrunk(std::size_t trunk)
{
  m_state->checkTrunk(trunk);
  m_state->removeTrunk(static_cast<int>(trunk));
}

void Smoother::mergeTrunks(std::size_t keep, std::size_t gone)
{
  m_state->checkTrunk(keep);
  m_state->checkTrunk(gone);
  require(keep != gone, "mergeTrunks, must be given two trunks");
  m_state->mergeTrunks(static_cast<int>(keep), static_cast<int>(gone));
}

void Smoother::keepTrunk(std::size_t trunk, bool is_kept)
{
  m_state->checkTrunk(trunk);
  m_state->trunks[trunk].is_kept = is_kept;
}

UpdateResult Smoother::update() { return m_state->update(); }

UpdateResult Smoother::optimize(double tolerance, int max_iterations)
{
  return m_state->optimize(tolerance, max_iterations);
}

Pose Smoother::pose(std::size_t pose) const
{
  m_state->checkPose(pose);
  return m_state->estimate(m_state->poses[pose]);
}

Trunk Smoother::trunk(std::size_t trunk) const
{
  m_state->checkTrunk(trunk);
  return m_state->estimate(m_state->trunks[trunk]);
}

std::size_t Smoother::poseCount() const { return m_state->poses.size(); }
std::size_t Smoother::observationCount() const { return m_state->live_observations; }

std::size_t Smoother::observationCount(std::size_t trunk) const
{
  m_state->checkTrunk(trunk);
  return static_cast<std::size_t>(m_state->trunks[trunk].observations);
}

double Smoother::cost() const { return m_state->costAtEstimate(); }

Matrix5d Smoother::trunkCovariance(std::size_t trunk) const
{
  m_state->checkTrunk(trunk);
  return m_state->trunkCovariance(static_cast<int>(trunk));
}

Eigen::Matrix2d Smoother::placeCovariance(std::size_t trunk) const
{
  m_state->checkTrunk(trunk);
  require(!m_state->poses.empty(), "placeCovariance, must follow addFirstPose");
  return m_state->placeCovariance(static_cast<int>(trunk));
}

Matrix6d Smoother::poseCovariance(std::size_t pose) const
{
  m_state->checkPose(pose);
  return m_state->poseCovariance(static_cast<int>(pose));
}

Matrix6d Smoother::currentPoseCovariance() const
{
  require(!m_state->poses.empty(), "currentPoseCovariance, must follow addFirstPose");
  return m_state->poseCovariance(static_cast<int>(m_state->poses.size()) - 1);
}

RelativeTrunk Smoother::predictedRelative(std::size_t trunk) const
{
  m_state->checkTrunk(trunk);
  require(!m_state->poses.empty(), "predictedRelative, must follow addFirstPose");
  return relativeTrunk(m_state->estimate(m_state->poses.back()), m_state->options.bMc,
                       m_state->estimate(m_state->trunks[trunk]));
}

Matrix4d Smoother::relativeCovariance(std::size_t trunk) const
{
  m_state->checkTrunk(trunk);
  require(!m_state->poses.empty(), "relativeCovariance, must follow addFirstPose");
  return m_state->relativeCovariance(static_cast<int>(trunk));
}

double Smoother::bearingVariance(std::size_t trunk) const
{
  m_state->checkTrunk(trunk);
  require(!m_state->poses.empty(), "bearingVariance, must follow addFirstPose");
  return m_state->bearingVariance(static_cast<int>(trunk));
}

Graph Smoother::graph() const { return m_state->graph(); }
std::size_t Smoother::memoryBytes() const { return m_state->memoryBytes(); }
} // namespace bole
