// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/pipeline.h>

#include <algorithm>
#include <chrono>
#include <limits>

namespace bole
{
/// Times the stages of a frame one after the other.
struct Pipeline::Lap
{
  FrameResult &result;
  std::chrono::steady_clock::time_point last = std::chrono::steady_clock::now();

  void operator()(const char *stage)
  {
    const auto now = std::chrono::steady_clock::now();
    result.timing_ms.emplace_back(stage, std::chrono::duration<double, std::milli>(now - last).count());
    last = now;
  }
};

namespace
{
SmootherOptions withCamera(SmootherOptions options, const Pose &bMc)
{
  options.bMc = bMc;
  return options;
}
} // namespace

Pipeline::Pipeline(const PinholeCamera &camera, const Pose &bMc, const Options &options)
    : Pipeline(camera, bMc, stageOptions(options, camera))
{
}

Pipeline::Pipeline(const PinholeCamera &camera, const Pose &bMc, const StageOptions &options)
    : m_camera(camera),
      m_bMc(bMc),
      m_options(options),
      m_motion(options.motion, options.points.gyro),
      m_points(camera, bMc, options.points),
      m_saliency(camera, options.saliency),
      m_smoother(withCamera(options.smoothing, bMc)),
      m_map(options.map)
{
  m_options.validate();
}

FrameResult Pipeline::process(const Frame &frame)
{
  m_sights.clear();
  FrameResult result;
  result.index = frame.index;
  result.stamp_ns = frame.stamp_ns;
  result.frame_status = frame.status;
  const double time_s = 1e-9 * static_cast<double>(frame.stamp_ns);
  Lap lap{result};

  const GyroBias bias = m_points.gyroBias();
  std::vector<RelativeMotion> motions;
  if (m_options.flow.use_points)
    motions = m_points.process(frame);
  lap("points");
  addPose(frame, bias, result);
  lap("predict");
  if (frame.status == FrameStatus::ok) {
    if (!m_visual)
      addRelativePoses(motions);
    lap("poses");
    Gradient gradient = computeGradient(frame.image, m_options.gradient);
    lap("gradient");
    if (m_options.flow.use_saliency)
      estimateSaliency(frame, result);
    lap("saliency");
    trackKnown(gradient, time_s, result);
    lap("tracking");
    result.smoother_status = m_smoother.update().status;
    lap("smoothing");
    keepView(frame, std::move(gradient));
    detectNew(result);
    lap("detection");
    placeSights();
    lookThroughTrunks();
    reviewMap(time_s);
    reviewScale(0.1, false);
    lap("map");
  }
  else
    m_smoother.update();

  const std::size_t pose = m_smoother.poseCount() - 1;
  result.wMb = m_smoother.pose(pose);
  if (pose > 0) {
    const double dt = 1e-9 * static_cast<double>(frame.stamp_ns - m_online.back().stamp_ns);
    m_velocity = result.wMb.minus(m_smoother.pose(pose - 1)) / std::max(dt, 1e-3);
  }
  m_online.push_back({frame.stamp_ns, result.wMb});
  m_motion.advance(frame);
  return result;
}

void Pipeline::addPose(const Frame &frame, const GyroBias &bias, FrameResult &result)
{
  m_indices.push_back(frame.index);
  if (m_smoother.poseCount() == 0) {
    if (frame.wMb_odometry)
      m_ground_z = 0;
    else if (m_options.flow.use_points) {
      m_visual.emplace(m_camera, m_bMc, m_options.visual);
      SmootherOptions options = m_smoother.options();
      options.max_iterations = std::min(options.max_iterations, m_options.visual.max_iterations);
      m_smoother = Smoother(options);
    }
    const PosePrior first = m_visual ? m_visual->first(frame, m_points.tracker()) : m_motion.first(frame);
    m_smoother.addFirstPose(first.mean, first.covariance);
    m_smoother.update();
    return;
  }
  const Pose wMa = m_smoother.pose(m_smoother.poseCount() - 1);
  MotionStep step = m_motion.step(frame, wMa, bias, m_velocity);
  std::vector<VisualLink> links;
  if (m_visual) {
    const bool was_turning = isTurning();
    step = visualStep(frame, step, links);
    if (was_turning && !isTurning())
      forgetUnranged();
  }
  const std::size_t pose = m_smoother.addPose(step.aMb, step.covariance);
  if (step.absolute)
    m_smoother.addPosePrior(pose, *step.absolute);
  for (const VisualLink &link : links)
    m_smoother.addOdometry(poseOf(link.a_index), poseOf(link.b_index), link.odometry);
  result.step_from_odometry = step.step_from_odometry;
  m_smoother.update();
}

std::size_t Pipeline::poseOf(std::size_t frame_index) const
{
  return static_cast<std::size_t>(std::lower_bound(m_indices.begin(), m_indices.end(), frame_index) -
                                  m_indices.begin());
}

void Pipeline::addRelativePoses(const std::vector<RelativeMotion> &motions)
{
  bool added = false;
  for (const RelativeMotion &motion : motions) {
    if (!motion.estimate.hasDirection()) {
      if (motion.estimate.hasRotation() && !motion.gyro) {
        addTurn(poseOf(motion.a_index), poseOf(motion.b_index), motion.estimate);
        added = true;
      }
      continue;
    }
    m_smoother.addRelativePose(poseOf(motion.a_index), poseOf(motion.b_index),
                               {motion.estimate.aRb, motion.estimate.direction, motion.estimate.covariance});
    added = true;
  }
  if (added)
    m_smoother.update();
}

/// A camera that only turns, without a gyro: its rotation, and nothing of its translation.
void Pipeline::addTurn(std::size_t a, std::size_t b, const RelativePoseEstimate &estimate)
{
  Odometry odometry;
  odometry.aMb.R = m_bMc.R * estimate.aRb * m_bMc.R.transpose();
  odometry.covariance.setZero();
  odometry.covariance.topLeftCorner<3, 3>() = 1e4 * Eigen::Matrix3d::Identity();
  odometry.covariance.bottomRightCorner<3, 3>() =
      m_bMc.R * estimate.covariance.topLeftCorner<3, 3>() * m_bMc.R.transpose() + 1e-8 * Eigen::Matrix3d::Identity();
  m_smoother.addOdometry(a, b, odometry);
}

void Pipeline::estimateSaliency(const Frame &frame, FrameResult &result)
{
  std::optional<RotationPrior> turn;
  std::optional<TranslationPrior> step;
  const std::size_t pose = m_smoother.poseCount() - 1;
  if (pose > 0) {
    const Pose pMc = cameraAt(pose - 1).inverse() * cameraAt(pose);
    if (result.step_from_odometry || m_visual || !frame.gyro.empty())
      turn = RotationPrior{pMc.R, 1e-6 * Eigen::Matrix3d::Identity()};
    if (result.step_from_odometry)
      step = TranslationPrior{pMc.t, 1e-4 * Eigen::Matrix3d::Identity()};
  }
  result.saliency = m_saliency.update(frame.image, turn, step);
}

void Pipeline::reviewMap(double time_s)
{
  constexpr double kLately_s = 1;
  refreshMap(time_s - kLately_s);
  const auto forgetRemoved = [this](int id) {
    const MapTrunk &trunk = m_map.trunks()[static_cast<std::size_t>(id)];
    if (trunk.removed && m_smoother.hasTrunk(trunk.smoother_id))
      m_smoother.removeTrunk(trunk.smoother_id);
  };
  for (const MapChange &change : m_map.review(!isTurning()))
    forgetRemoved(change.id);
  for (const int id : m_map.leaveBehind(time_s))
    forgetRemoved(id);
}

/// Covariances are asked for where something was seen lately: that of a trunk left behind hardly changes, and costs a
/// walk back to where it stood.
void Pipeline::refreshMap(double seen_since_s)
{
  for (const std::size_t i : m_map.active()) {
    MapTrunk &trunk = m_map.trunks()[i];
    trunk.trunk = m_smoother.trunk(trunk.smoother_id);
    if (trunk.last_seen_s >= seen_since_s)
      trunk.covariance = m_smoother.trunkCovariance(trunk.smoother_id);
  }
}

/// Also where the candidates stand that were left behind; there are too many to ask for their covariances.
void Pipeline::refreshWholeMap()
{
  for (MapTrunk &trunk : m_map.trunks())
    if (!trunk.removed)
      trunk.trunk = m_smoother.trunk(trunk.smoother_id);
  refreshMap(-std::numeric_limits<double>::infinity());
}

std::vector<TrunkRecord> Pipeline::map() const
{
  std::vector<TrunkRecord> records = m_map.records(m_ground_z.value_or(0));
  if (m_smoother.poseCount() == 0 || isTurning())
    return records;
  const Eigen::Vector2d origin = m_smoother.pose(0).t.head<2>();
  const double sigma = m_visual ? estimateScale(true).sigma : m_options.motion.scale_sigma;
  const double variance = sigma * sigma;
  for (TrunkRecord &record : records) {
    const Eigen::Vector2d by_log_scale = record.xy - origin;
    record.covariance_xy += variance * by_log_scale * by_log_scale.transpose();
    record.variance_radius += variance * record.radius * record.radius;
  }
  return records;
}

void Pipeline::finish()
{
  if (m_smoother.poseCount() == 0)
    return;
  constexpr double kSettled = 1e-6; // of the cost: no view notices
  m_smoother.optimize(kSettled);
  refreshWholeMap();
  reviewScale(0, true);
}

std::vector<Pipeline::StampedPose> Pipeline::smoothedTrajectory() const
{
  std::vector<StampedPose> trajectory;
  for (std::size_t i = 0; i < m_online.size(); ++i)
    trajectory.push_back({m_online[i].stamp_ns, m_smoother.pose(i)});
  return trajectory;
}
} // namespace bole
