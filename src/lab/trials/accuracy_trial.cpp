// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/trials/accuracy_trial.h"
#include "evaluation/visibility.h"
#include "geometry/median.h"
#include "lab/simulation/h264_link.h"

#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
constexpr std::int64_t kImuPeriodNs = 5000000;

struct Recorded
{
  Trajectory truth, odometry;
  std::vector<double> frame_ms;
};

/// The frames of a scene, one after the other.
class SceneFrames
{
public:
  SceneFrames(const SceneOptions &scene, const FlightPath &path, const Forest &forest)
      : m_scene(scene), m_path(path), m_renderer(forest, scene.renderer), m_filter(scene.sensors), m_imu(scene.sensors)
  {
    const PinholeCamera &camera = scene.renderer.camera.pinhole;
    if (scene.h264_kbps > 0)
      m_link.emplace(camera.width, camera.height, scene.rate_hz, scene.h264_kbps);
  }

  void next(Frame &frame)
  {
    frame.index = m_index;
    frame.stamp_ns = std::llround(static_cast<double>(m_index++) * 1e9 / m_scene.rate_hz);
    const double t = 1e-9 * static_cast<double>(frame.stamp_ns), half = 0.5e-3 * m_scene.exposure_ms;
    const Pose bMc = forwardCamera();
    RenderedFrame rendered;
    m_renderer.render(m_path.bodyPose(t - half) * bMc, m_path.bodyPose(t + half) * bMc, rendered);
    if (m_link)
      m_link->pass(rendered.image);
    frame.image = rendered.image;
    frame.wMb_truth = m_path.bodyPose(t);
    frame.wMb_odometry = m_filter.report(*frame.wMb_truth);
    for (; m_imu_stamp <= frame.stamp_ns; m_imu_stamp += kImuPeriodNs) {
      const double s = 1e-9 * static_cast<double>(m_imu_stamp);
      const ImuSample sample = m_imu.measure(m_path.bodyPose(s).R, m_path.bodyRate(s), m_path.acceleration(s));
      if (m_imu_stamp > 0)
        frame.gyro.push_back({m_imu_stamp, sample.gyro});
    }
  }

private:
  const SceneOptions &m_scene;
  const FlightPath &m_path;
  ForestRenderer m_renderer;
  PoseFilter m_filter;
  SimulatedImu m_imu;
  std::optional<H264Link> m_link;
  std::size_t m_index = 0;
  std::int64_t m_imu_stamp = 0;
};

TrajectoryErrors errorsUnder(const Trajectory &estimate, const Trajectory &truth, Alignment alignment)
{
  const std::vector<PosePair> pairs = pairPoses(estimate, truth);
  return absoluteErrors(pairs, align(pairs, alignment));
}

void compare(AccuracyTrialResult &result, const Pipeline &pipeline, const Recorded &recorded, const Forest &forest,
             const PinholeCamera &camera)
{
  Trajectory smoothed;
  for (const auto &pose : pipeline.smoothedTrajectory())
    smoothed.push_back({pose.stamp_ns, pose.wMb});
  result.trajectory = errorsUnder(smoothed, recorded.truth, Alignment::xy_yaw);
  result.trajectory_scaled = errorsUnder(smoothed, recorded.truth, Alignment::xy_yaw_scale);
  result.odometry = errorsUnder(recorded.odometry, recorded.truth, Alignment::xy_yaw);
  result.odometry_scaled = errorsUnder(recorded.odometry, recorded.truth, Alignment::xy_yaw_scale);
  const std::vector<TruthTrunk> truth = truthOf(forest);
  std::vector<Pose> poses;
  for (const StampedPose &pose : recorded.truth)
    poses.push_back(pose.wMb);
  result.trunks = trunkMetrics(pipeline.map(), truth, trunkVisibility(truth, poses, forwardCamera(), camera),
                               alignAll(pairPoses(smoothed, recorded.truth)));
  result.median_ms = medianOf(recorded.frame_ms);
}
} // namespace

std::vector<TruthTrunk> truthOf(const Forest &forest)
{
  std::vector<TruthTrunk> truth;
  for (const SimulatedTrunk &trunk : forest.trunks) // where and as thick as they are at breast height
    truth.push_back(
        {trunk.id, trunk.axisAt(kBreastHeight).head<2>(), trunk.radiusAt(kBreastHeight), std::atan(trunk.lean.norm())});
  for (const SimulatedTrunk &trunk : forest.far_trunks)
    truth.push_back({trunk.id, trunk.axisAt(kBreastHeight).head<2>(), 0, 0});
  return truth;
}

AccuracyTrialResult runAccuracyTrial(const SceneOptions &scene, int frames, const Options &options,
                                     const std::function<bool()> &is_cancelled)
{
  scene.validate();
  if (frames < 2)
    throw vpException(vpException::badValue, "frames = %d, must be at least 2", frames);
  FlightOptions flight = scene.flight;
  flight.duration = (frames - 1) / scene.rate_hz;
  const FlightPath path(flight);
  std::vector<SimulatedTrunk> wanted = scene.trunks;
  const std::vector<SimulatedTrunk> gates = path.gates();
  wanted.insert(wanted.end(), gates.begin(), gates.end());
  const Forest forest = Forest::plant(scene.forest, path.waypoints(), wanted);
  SceneFrames source(scene, path, forest);
  const PinholeCamera camera = scene.renderer.camera.pinhole;
  Pipeline pipeline(camera, forwardCamera(), options);
  Recorded recorded;
  for (int k = 0; k < frames && !(is_cancelled && is_cancelled()); ++k) {
    Frame frame;
    source.next(frame);
    recorded.truth.push_back({frame.stamp_ns, *frame.wMb_truth});
    recorded.odometry.push_back({frame.stamp_ns, *frame.wMb_odometry});
    frame.wMb_truth.reset();
    const auto start = std::chrono::steady_clock::now();
    pipeline.process(frame);
    recorded.frame_ms.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
  }
  AccuracyTrialResult result;
  if (recorded.truth.size() < 2)
    return result;
  pipeline.finish();
  compare(result, pipeline, recorded, forest, camera);
  return result;
}
} // namespace bole
