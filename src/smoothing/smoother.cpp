// SPDX-License-Identifier: GPL-2.0-or-later
// The public face: checks what the caller gives, and keeps the graph.
#include "smoothing/state.h"

#include "geometry/failure.h"
#include "geometry/names.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
void require(bool holds, const char *message)
{
  if (!holds)
    throw badValue("{}", message);
}
} // namespace

void Smoother::State::checkPose(std::size_t pose) const
{
  if (pose >= poses.size())
    throw badValue("pose = {}, must be below {}", pose, poses.size());
}

void Smoother::State::checkTrunk(std::size_t trunk) const
{
  if (trunk >= trunks.size() || trunks[trunk].is_removed)
    throw badValue("trunk = {}, must be one of the {} and not removed", trunk, trunks.size());
}

std::size_t Smoother::State::newPose(const Pose &wMb)
{
  require(wMb.isFinite(), "pose, must be finite");
  poses.push_back(wMb);
  points.emplace_back();
  factors.emplace_back();
  return poses.size() - 1;
}

std::size_t Smoother::State::newTrunk(const Trunk &guess, const TrunkPrior &trunk_prior)
{
  require(guess.minus(Trunk()).allFinite() && trunk_prior.mean.minus(Trunk()).allFinite() &&
              trunk_prior.sigma.allFinite() && (trunk_prior.sigma.array() > 0).all(),
          "trunk, must be finite with sigmas above 0");
  TrunkState trunk;
  trunk.value = guess;
  trunk.prior = trunk_prior;
  trunk.covariance = trunk_prior.sigma.cwiseAbs2().asDiagonal();
  trunk.place_covariance = trunk.covariance.topLeftCorner<2, 2>();
  std::size_t number = trunks.size();
  if (free_trunks.empty())
    trunks.push_back(trunk);
  else {
    number = free_trunks.back();
    free_trunks.pop_back();
    trunks[number] = trunk;
    if (number < window_places.trunk.size())
      window_places.trunk[number] = -1;
  }
  return number;
}

/// Notes a view. What was forgotten of a trunk but its place is a prior now: how far the path has drifted since is not
/// known any more.
void Smoother::State::noteView(std::size_t pose, std::size_t trunk)
{
  TrunkState &seen = trunks[trunk];
  if (seen.is_absorbed) {
    seen.prior.mean = seen.value;
    seen.prior.sigma = seen.covariance.diagonal().cwiseSqrt();
    seen.prior.sigma.head<2>().setConstant(options.prior_position_sigma);
    seen.is_absorbed = false;
  }
  if (seen.is_kept && !seen.point && !seen.seen.empty() && seen.seen.back() < first_open)
    is_whole_due = true; // it was out of sight for long
  seen.seen.insert(std::upper_bound(seen.seen.begin(), seen.seen.end(), pose), pose);
  seen.last_seen = std::max(seen.last_seen, pose);
}

void Smoother::State::removeTrunk(std::size_t trunk)
{
  TrunkState &gone = trunks[trunk];
  const auto isOf = [trunk](const auto &factor) { return factor.trunk == trunk; };
  for (const std::size_t pose : gone.seen) {
    FactorsOfPose &all = factorsOf(pose);
    all.views.erase(std::remove_if(all.views.begin(), all.views.end(), isOf), all.views.end());
  }
  gone.seen.clear();
  gone.is_removed = true;
  is_whole_due |= gone.point.has_value(); // else its views stay in the prior
  if (options.forgets && !gone.point && !gone.is_free) {
    gone.is_free = true;
    free_trunks.push_back(trunk);
  }
}

void Smoother::State::mergeTrunks(std::size_t keep, std::size_t gone)
{
  TrunkState &kept = trunks[keep], &merged = trunks[gone];
  is_whole_due |= merged.point || !isInWindow(kept) || (!merged.seen.empty() && merged.seen.front() < first_open);
  for (const std::size_t pose : merged.seen) {
    FactorsOfPose &all = factorsOf(pose);
    for (ViewFactor &view : all.views)
      if (view.trunk == gone)
        view.trunk = keep;
  }
  std::vector<std::size_t> seen;
  std::merge(kept.seen.begin(), kept.seen.end(), merged.seen.begin(), merged.seen.end(), std::back_inserter(seen));
  kept.seen = std::move(seen);
  kept.last_seen = std::max(kept.last_seen, merged.last_seen);
  merged.seen.clear();
  if (merged.point)
    mergeInPrior(keep, gone);
  removeTrunk(gone);
}

/// What the prior says of \p gone it says of \p keep: x_gone = x_keep puts its offset at that of the other and the
/// difference of their points.
void Smoother::State::mergeInPrior(std::size_t keep, std::size_t gone)
{
  const auto find = [this](std::size_t trunk, int &row) {
    row = 0;
    for (std::size_t i = 0; i < prior.names.size(); ++i) {
      if (!prior.names[i].is_pose && prior.names[i].number == trunk)
        return i;
      row += prior.names[i].is_pose ? 6 : 5;
    }
    return prior.names.size();
  };
  int to = 0, from = 0;
  const std::size_t kept = find(keep, to), merged = find(gone, from);
  TrunkState &state = trunks[keep];
  if (kept == prior.names.size()) { // takes its place
    prior.names[merged].number = keep;
    state.point = trunks[gone].point;
  }
  else {
    const Vector5d apart = state.point->minus(*trunks[gone].point);
    const Eigen::Index n = prior.g.size();
    prior.g -= prior.H.middleCols<5>(from) * apart;
    Eigen::MatrixXd T = Eigen::MatrixXd::Zero(n, n - 5); // offsets from those without the merged
    T.topLeftCorner(from, from).setIdentity();
    T.bottomRightCorner(n - from - 5, n - from - 5).setIdentity();
    T.block<5, 5>(from, to < from ? to : to - 5).setIdentity();
    prior.H = T.transpose() * prior.H * T;
    prior.g = T.transpose() * prior.g;
    prior.names.erase(prior.names.begin() + static_cast<std::ptrdiff_t>(merged));
  }
  trunks[gone].point.reset();
}

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
  for (const Graph::TrunkVertex &vertex : graph.trunks)
    state.newTrunk(vertex.trunk, vertex.prior);
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
  return addPose(aMb, covariance, m_state->poses.back() * aMb);
}

std::size_t Smoother::addPose(const Pose &aMb, const Matrix6d &covariance, const Pose &wMb_guess)
{
  require(!m_state->poses.empty(), "addPose, must follow addFirstPose");
  require(aMb.isFinite(), "odometry, must be finite");
  squareRootInformation<6>(covariance, "odometry covariance");
  const std::size_t pose = m_state->newPose(wMb_guess);
  addOdometry(pose - 1, pose, {aMb, covariance});
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
  require(m_state->isHeld(pose), "pose, must be inside the window");
  SquareRootSummary root;
  const SummaryStatus status = squareRoot(summary, root);
  if (status == SummaryStatus::ok || status == SummaryStatus::projected) {
    m_state->noteView(pose, trunk);
    m_state->factorsOf(pose).views.push_back({trunk, root});
  }
  return status;
}

void Smoother::addRelativePose(std::size_t a, std::size_t b, const RelativePoseMeasurement &measurement)
{
  m_state->checkPose(a);
  m_state->checkPose(b);
  require(a != b, "relative pose, must be between two poses");
  require(measurement.caRcb.allFinite() && std::abs(measurement.direction.norm() - 1) < 1e-6,
          "relative pose, must be finite with a direction of length 1");
  const std::size_t first = std::min(a, b);
  if (m_state->isHeld(first))
    m_state->factorsOf(first).directions.push_back({a, b, measurement, squareRootInformation(measurement)});
}

void Smoother::addOdometry(std::size_t a, std::size_t b, const Odometry &odometry)
{
  m_state->checkPose(a);
  m_state->checkPose(b);
  require(a != b, "odometry, must be between two poses");
  require(odometry.aMb.isFinite(), "odometry, must be finite");
  const std::size_t first = std::min(a, b);
  if (!m_state->isHeld(first))
    return;
  m_state->factorsOf(first).steps.push_back({a, b, odometry, squareRootInformation(odometry)});
  m_state->is_whole_due |= first < m_state->first_open; // a loop
}

void Smoother::addPosePrior(std::size_t pose, const PosePrior &prior)
{
  m_state->checkPose(pose);
  require(m_state->isHeld(pose), "pose, must be inside the window");
  require(prior.mean.isFinite(), "pose prior, must be finite");
  m_state->factorsOf(pose).absolutes.push_back({prior, squareRootInformation(prior)});
  m_state->is_whole_due |= pose < m_state->first_open;
}

void Smoother::removeTrunk(std::size_t trunk)
{
  m_state->checkTrunk(trunk);
  m_state->removeTrunk(trunk);
}

void Smoother::mergeTrunks(std::size_t keep, std::size_t gone)
{
  m_state->checkTrunk(keep);
  m_state->checkTrunk(gone);
  require(keep != gone, "mergeTrunks, must be given two trunks");
  m_state->mergeTrunks(keep, gone);
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
  return m_state->poses[pose];
}

Trunk Smoother::trunk(std::size_t trunk) const
{
  m_state->checkTrunk(trunk);
  return m_state->trunks[trunk].value;
}

std::size_t Smoother::poseCount() const { return m_state->poses.size(); }

std::size_t Smoother::observationCount() const
{
  std::size_t count = 0;
  for (const FactorsOfPose &all : m_state->factors)
    count += all.views.size();
  return count;
}

std::size_t Smoother::observationCount(std::size_t trunk) const
{
  m_state->checkTrunk(trunk);
  return m_state->trunks[trunk].seen.size();
}

double Smoother::cost() const
{
  return m_state->options.forgets ? m_state->addWindow(nullptr) : m_state->addWhole(m_state->placeWhole(), nullptr);
}

Matrix5d Smoother::trunkCovariance(std::size_t trunk) const
{
  m_state->checkTrunk(trunk);
  return m_state->trunkCovariance(trunk);
}

Eigen::Matrix2d Smoother::placeCovariance(std::size_t trunk) const
{
  m_state->checkTrunk(trunk);
  require(!m_state->poses.empty(), "placeCovariance, must follow addFirstPose");
  return m_state->placeCovariance(trunk);
}

Matrix6d Smoother::poseCovariance(std::size_t pose) const
{
  m_state->checkPose(pose);
  return m_state->poseCovariance(pose);
}

Matrix6d Smoother::currentPoseCovariance() const
{
  require(!m_state->poses.empty(), "currentPoseCovariance, must follow addFirstPose");
  return m_state->poseCovariance(m_state->poses.size() - 1);
}

RelativeTrunk Smoother::predictedRelative(std::size_t trunk) const
{
  m_state->checkTrunk(trunk);
  require(!m_state->poses.empty(), "predictedRelative, must follow addFirstPose");
  return relativeTrunk(m_state->poses.back(), m_state->options.bMc, m_state->trunks[trunk].value);
}

Matrix4d Smoother::relativeCovariance(std::size_t trunk) const
{
  m_state->checkTrunk(trunk);
  require(!m_state->poses.empty(), "relativeCovariance, must follow addFirstPose");
  return m_state->relativeCovariance(m_state->poses.size() - 1, trunk, Matrix4d::Identity());
}

double Smoother::bearingVariance(std::size_t trunk) const
{
  constexpr int kBearing = 2;
  m_state->checkTrunk(trunk);
  require(!m_state->poses.empty(), "bearingVariance, must follow addFirstPose");
  return m_state->relativeCovariance(m_state->poses.size() - 1, trunk, Eigen::RowVector4d::Unit(kBearing))(0, 0);
}

Graph Smoother::graph() const { return m_state->graph(); }

const char *toString(UpdateStatus status) { return nameOf(status, {"ok", "iteration limit", "degenerate"}); }

Pose SmootherOptions::forwardCamera()
{
  Pose bMc;
  bMc.R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return bMc;
}

void SmootherOptions::validate() const
{
  const auto positive = [](const char *name, double value) {
    if (!(value > 0) || !std::isfinite(value))
      throw badValue("{} = {:g}, must be above 0", name, value);
  };
  positive("summary_loss.width", summary_loss.width);
  positive("direction_loss.width", direction_loss.width);
  positive("prior_radius", prior_radius);
  positive("prior_log_radius_sigma", prior_log_radius_sigma);
  positive("prior_lean_sigma", prior_lean_sigma);
  positive("prior_position_sigma", prior_position_sigma);
  if (max_iterations < 1)
    throw badValue("max_iterations = {}, must be at least 1", max_iterations);
  if (window < 2)
    throw badValue("window = {}, must be at least 2", window);
  if (remembered < 0)
    throw badValue("remembered = {}, must be at least 0", remembered);
  if (!bMc.isFinite())
    throw badValue("bMc, must be finite");
}
} // namespace bole
