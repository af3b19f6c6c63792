// SPDX-License-Identifier: GPL-2.0-or-later
#include "paper/paper_mapper.h"

#include "paper/tree_energy.h"
#include <bole/options.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <visp3/core/vpException.h>

namespace bole::paper
{
namespace
{
/// p(theta): the radius about its median, upright; the place only keeps what nothing holds.
TrunkPrior priorOf(const Trunk &guess)
{
  constexpr double kPlace = 50, kUpright = 1e-4; // [m], [tan]
  const Options::Trunks usual;
  TrunkPrior prior;
  prior.mean.xy = guess.xy;
  prior.mean.log_radius = std::log(usual.radius);
  prior.sigma << kPlace, kPlace, usual.radius_sigma, kUpright, kUpright;
  return prior;
}

/// "z_t of the robot's odometry from an on-board pose filter": its relative pose, and the noise of it.
Odometry stepOf(const StampedPose &before, const StampedPose &now)
{
  constexpr double kStep_s = 0.1, kLeast_s = 1e-3; // for which the noise is stated
  const Options::Odometry noise;
  const double walked =
      std::sqrt(std::max(1e-9 * static_cast<double>(now.stamp_ns - before.stamp_ns), kLeast_s) / kStep_s);
  Odometry step;
  step.aMb = before.wMb.inverse() * now.wMb;
  const double along = noise.scale * step.aMb.t.norm() / walked, across = std::hypot(walked * noise.step, along);
  Vector6d sigma;
  sigma << across, across, std::hypot(noise.step_vertical, along), Eigen::Vector3d::Constant(noise.turn);
  step.covariance = sigma.cwiseAbs2().asDiagonal();
  return step;
}
} // namespace

std::optional<Turn> gyroTurn(const std::vector<GyroSample> &samples, std::int64_t from_ns, std::int64_t to_ns,
                             const Pose &bMc)
{
  constexpr std::int64_t kMostGap_ns = 100000000;
  if (samples.empty())
    return std::nullopt;
  Pose turned; // of the body
  std::int64_t at = from_ns;
  for (std::size_t i = 0; i <= samples.size() && at < to_ns; ++i) { // up to each sample, and on from the last
    const GyroSample &before = samples[i > 0 ? i - 1 : 0], &after = i < samples.size() ? samples[i] : before;
    const std::int64_t end = i < samples.size() ? std::min(after.stamp_ns, to_ns) : to_ns;
    if (end <= at)
      continue;
    if (end - at > kMostGap_ns)
      return std::nullopt;
    Vector6d step = Vector6d::Zero();
    step.tail<3>() = 0.5e-9 * static_cast<double>(end - at) * (before.rate + after.rate);
    turned = turned.plus(step);
    at = end;
  }
  return Turn(bMc.R.transpose() * turned.R * bMc.R);
}

const vpImage<float> &Saliency::update(const vpImage<unsigned char> &image, const std::optional<Turn> &turn)
{
  GreyImage current(image);
  m_background = vpImage<float>(image.getHeight(), image.getWidth(), 0.5f);
  if (m_previous) {
    const TurnAndLabels found = estimateTurn(*m_previous, current, m_camera, turn.value_or(m_turn));
    m_turn = found.pRc;
    for (unsigned i = 0; i < m_background.getSize(); ++i)
      m_background.bitmap[i] = 1 / (1 + std::exp(-found.log_ratio.bitmap[i])); // Eq. 10, p(lambda = 1) = 0.5
  }
  m_previous = std::move(current);
  return m_background;
}

PaperMapper::PaperMapper(const PinholeCamera &camera, const Pose &bMc, double alpha, const LineQuartiles &quartiles)
    : m_camera(camera), m_alpha(alpha), m_quartiles(quartiles), m_saliency(camera)
{
  m_graph.bMc = bMc;
}

FrameReport PaperMapper::process(const Frame &frame)
{
  if (!frame.wMb_odometry)
    throw vpException(vpException::badValue, "paper: frame %zu has no pose of a pose filter, which the method needs",
                      frame.index);
  std::optional<Turn> turn;
  if (!m_odometry.empty())
    turn = gyroTurn(frame.gyro, m_odometry.back().stamp_ns, frame.stamp_ns, m_graph.bMc);
  addPose(frame);
  optimiseJointly(m_graph);
  FrameReport report;
  if (frame.status == FrameStatus::ok) {
    const SplitGradient gradient = splitGradient(frame.image); // Section 4.1
    m_saliency.update(frame.image, turn);                      // Eq. 10 to 17
    const std::size_t known = m_trees.size();
    if (m_graph.poses.size() > 1) // without a frame before there is no saliency
      instantiate(gradient);      // Eq. 18 to 21
    std::vector<std::size_t> observed;
    for (std::size_t i = 0; i < m_trees.size(); ++i)
      if (m_trees[i].is_observed)
        observed.push_back(i);
    const TreeEnergy energy(gradient, m_camera, m_alpha);
    optimiseJointly(m_graph, &energy, observed);                                          // Eq. 2 to 4
    report.trunks = summarise(energy, known, 1e-9 * static_cast<double>(frame.stamp_ns)); // Eq. 9
    optimiseJointly(m_graph);
    report.saliency =
        SaliencyField{m_saliency.background(), vpImage<float>(frame.image.getHeight(), frame.image.getWidth(), 1.f), 0};
  }
  report.index = m_graph.poses.size() - 1;
  report.stamp_ns = frame.stamp_ns;
  report.frame_status = frame.status;
  report.reason = frame.message;
  report.wMb = m_graph.poses.back().wMb;
  report.wMc = camera();
  report.is_translation_seen = true;
  return report;
}

void PaperMapper::addPose(const Frame &frame)
{
  constexpr double kAnchor = 1e-6; // variance: p(x_1) "serves only to anchor"
  const StampedPose now{frame.stamp_ns, *frame.wMb_odometry};
  const std::size_t next = m_graph.poses.size();
  Graph::PoseVertex pose{static_cast<std::int64_t>(next), now.wMb};
  if (next == 0) {
    m_graph.pose_priors.push_back({0, {now.wMb, kAnchor * Matrix6d::Identity()}});
  }
  else {
    m_graph.odometry.push_back({next - 1, next, stepOf(m_odometry.back(), now)});
    pose.wMb = m_graph.poses.back().wMb * m_graph.odometry.back().odometry.aMb;
  }
  m_graph.poses.push_back(pose);
  m_odometry.push_back(now);
}

/// Columns of the level frame that the trees take which are looked for.
std::vector<TakenRange> PaperMapper::takenRanges() const
{
  constexpr double kBefore = 0.3;  // less far ahead a tree is beside the image [m]
  constexpr double kMargin_px = 1; // a border in the image is as wide
  std::vector<TakenRange> ranges;
  const Pose wMc = camera();
  const Eigen::Vector2d forward = wMc.R.col(2).head<2>().normalized(), left(-forward.y(), forward.x());
  for (std::size_t i = 0; i < m_trees.size(); ++i) {
    const Trunk &trunk = m_graph.trunks[i].trunk;
    const Eigen::Vector2d to = trunk.axisAt(wMc.t.z()).head<2>() - wMc.t.head<2>();
    const double r = trunk.radius(), d2 = to.squaredNorm();
    if (!m_trees[i].is_observed || to.dot(forward) < kBefore || d2 < 1.1 * r * r)
      continue;
    const double q = to.dot(left) / to.dot(forward), half = r / std::sqrt(d2 - r * r) + kMargin_px / m_camera.fx;
    ranges.push_back({q - half, q + half});
  }
  return ranges;
}

/// Pairs of lines, each a tree whose range is that of the median radius.
void PaperMapper::instantiate(const SplitGradient &gradient)
{
  const Pose wMc = camera();
  for (const NewTree &found :
       detectTrees(gradient, m_saliency.background(), m_camera, wMc.R, takenRanges(), m_quartiles)) {
    const Trunk guess = trunkFromRelative(wMc, found.relative, Options::Trunks().radius);
    m_graph.trunks.push_back({0, guess, priorOf(guess)});
    m_trees.emplace_back();
  }
}

RelativeTrunk PaperMapper::seen(std::size_t tree) const
{
  return relativeTrunk(m_graph.poses.back().wMb, m_graph.bMc, m_graph.trunks[tree].trunk);
}

/// Eq. 9 at the joint optimum, and the end of those whose energy is not convex there. One of the new trees, those from
/// \p known on, that no image has measured is none.
std::vector<TrunkInView> PaperMapper::summarise(const TreeEnergy &energy, std::size_t known, double time_s)
{
  constexpr double kDrawn = 1; // of the endless line, what pictures show [tan]
  std::vector<TrunkInView> in_view;
  std::size_t kept = 0; // trees so far
  for (std::size_t i = 0; i < m_trees.size(); ++i) {
    Tree &tree = m_trees[i];
    const bool was_looked_for = tree.is_observed;
    const std::optional<SummaryFactor> summary = was_looked_for ? minimised(energy, seen(i)) : std::nullopt;
    if (i >= known && !summary)
      continue;
    tree.is_observed = summary.has_value();
    const RelativeTrunk relative = summary ? summary->optimum : seen(i);
    if (summary) {
      m_graph.observations.push_back({m_graph.poses.size() - 1, kept, *summary});
      tree.first_s = tree.views++ == 0 ? time_s : tree.first_s;
      tree.last_s = time_s;
    }
    if (was_looked_for && relative.isFinite())
      in_view.push_back({static_cast<int>(kept), TrunkStatus::confirmed, tree.is_observed,
                         tree.is_observed ? "tracked" : "negative curvature", relative, -kDrawn, kDrawn,
                         (m_graph.trunks[i].trunk.axisAt(camera().t.z()) - camera().t).norm()});
    m_graph.trunks[kept] = m_graph.trunks[i];
    m_graph.trunks[kept].id = static_cast<std::int64_t>(kept);
    m_trees[kept++] = tree;
  }
  m_graph.trunks.resize(kept);
  m_trees.resize(kept);
  return in_view;
}

void PaperMapper::finish()
{
  optimiseJointly(m_graph);
  m_covariances = treeCovariances(m_graph);
}

std::vector<TrunkRecord> PaperMapper::map() const
{
  const double scale = Options::Odometry().scale; // the error that all lengths share
  std::vector<TrunkRecord> records;
  for (std::size_t i = 0; i < m_trees.size(); ++i) {
    const Trunk &trunk = m_graph.trunks[i].trunk;
    TrunkRecord record;
    record.id = static_cast<int>(i);
    record.xy = trunk.axisAt(kBreastHeight).head<2>();
    record.radius = trunk.radius();
    record.lean = trunk.lean;
    record.probability = 1;
    record.observations = m_trees[i].views;
    record.first_seen_s = m_trees[i].first_s;
    record.last_seen_s = m_trees[i].last_s;
    record.status = TrunkStatus::confirmed;
    if (i < m_covariances.size()) {
      Matrix5d J = Matrix5d::Identity(); // from the foot and the log radius to breast height and the radius
      J.topRightCorner<2, 2>() = kBreastHeight * Eigen::Matrix2d::Identity();
      J(2, 2) = record.radius;
      Vector5d by_scale;
      by_scale << record.xy - m_graph.poses[0].wMb.t.head<2>(), record.radius, 0, 0;
      record.covariance = J * m_covariances[i] * J.transpose() + scale * scale * by_scale * by_scale.transpose();
    }
    records.push_back(record);
  }
  return records;
}

Trajectory PaperMapper::smoothedTrajectory() const
{
  Trajectory trajectory = m_odometry;
  for (std::size_t i = 0; i < trajectory.size(); ++i)
    trajectory[i].wMb = m_graph.poses[i].wMb;
  return trajectory;
}
} // namespace bole::paper
