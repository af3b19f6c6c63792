// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/trials/accuracy_trial.h"
#include "evaluation/visibility.h"
#include "geometry/median.h"
#include "geometry/require_range.h"

#include <chrono>
#include <cmath>

namespace bole
{
namespace
{
struct Recorded
{
  Trajectory truth, odometry;
  std::vector<double> frame_ms;
};

TrajectoryErrors errorsUnder(const Trajectory &estimate, const Trajectory &truth, Alignment alignment)
{
  const std::vector<PosePair> pairs = pairPoses(estimate, truth);
  return absoluteErrors(pairs, align(pairs, alignment));
}

void compare(AccuracyTrialResult &result, const Pipeline &pipeline, const Recorded &recorded, const Forest &forest,
             const PinholeCamera &camera)
{
  const Trajectory smoothed = pipeline.smoothedTrajectory();
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
  requireRange("frames", frames, 2, 100000);
  SceneFrames source(scene, frames);
  const PinholeCamera camera = scene.renderer.camera.pinhole;
  Pipeline pipeline(camera, forwardCamera(), options);
  Recorded recorded;
  Frame frame;
  RenderedFrame rendered;
  for (int k = 0; k < frames && !(is_cancelled && is_cancelled()); ++k) {
    source.next(frame, rendered);
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
  compare(result, pipeline, recorded, source.forest(), camera);
  return result;
}
} // namespace bole
