// SPDX-License-Identifier: GPL-2.0-or-later
#include "evaluation/trajectory_metrics.h"
#include "evaluation/trunk_metrics.h"
#include "geometry/failure.h"
#include "input/recorded_source.h"
#include "input/trajectory.h"
#include "output/flight_trace.h"
#include "output/summary_json.h"
#include "output/trunks_csv.h"
#include <bole/evaluation.h>
#include <bole/open_source.h>

#include <filesystem>
#include <map>

namespace bole
{
namespace
{
/// Length of the horizontal path of the estimates [m].
double pathLength(const std::vector<PosePair> &pairs)
{
  double length = 0;
  for (std::size_t i = 1; i < pairs.size(); ++i)
    length += (pairs[i].estimate.t - pairs[i - 1].estimate.t).head<2>().norm();
  return length;
}

TrajectoryReport report(const std::vector<PosePair> &pairs)
{
  TrajectoryReport result;
  const Alignments alignments = alignAll(pairs);
  for (std::size_t a = 0; a < alignments.size(); ++a)
    result.absolute[a] = absoluteErrors(pairs, alignments[a]);
  constexpr double kRest = 1e-3; // a path shorter than this has no scale [m]
  if (pathLength(pairs) > kRest)
    result.scale = at(alignments, Alignment::xy_yaw_scale).scale;
  if (pairs.size() > 1)
    result.over_frame = relativeErrors(pairs, (pairs[1].stamp_ns - pairs[0].stamp_ns) * 1e-9);
  result.over_second = relativeErrors(pairs, 1);
  return result;
}

/// What a run is compared with.
struct Reference
{
  Trajectory trajectory, odometry;
  std::size_t frames = 0;
  std::int64_t first_stamp_ns = 0;
  std::vector<TruthTrunk> trunks;
  std::vector<TrunkVisibility> visibility;
};

/// What the run says of its world; one of an earlier version, which says nothing, had odometry.
WorldReference worldOf(const std::string &summary)
{
  return std::filesystem::exists(summary) ? readReference(summary) : WorldReference();
}

/// Without odometry the world stands at the height of the first camera: the mean height is free too.
void levelHeights(std::vector<PosePair> &pairs)
{
  double off = 0;
  for (const PosePair &pair : pairs)
    off += (pair.truth.t.z() - pair.estimate.t.z()) / static_cast<double>(pairs.size());
  for (PosePair &pair : pairs)
    pair.estimate.t.z() += off;
}

/// True poses at the stamps of the frames.
std::vector<Pose> truePoses(const AslSource &source)
{
  std::vector<Pose> poses;
  for (const std::int64_t stamp_ns : source.stamps())
    if (const auto wMb = interpolate(source.truth(), stamp_ns))
      poses.push_back(*wMb);
  return poses;
}

Reference readSequence(const std::string &sequence)
{
  const AslSource source(sequence);
  if (source.truth().empty())
    throw ioError("{}: no ground truth (state_groundtruth_estimate0/data.csv)", sequence);
  Reference reference;
  reference.trajectory = source.truth();
  reference.odometry = source.odometry();
  reference.frames = source.size();
  reference.first_stamp_ns = source.stamps().empty() ? source.truth().front().stamp_ns : source.stamps().front();
  reference.trunks = readTruthTrunks(sequence);
  reference.visibility = trunkVisibility(reference.trunks, truePoses(source), source.bMc(), source.camera());
  return reference;
}

Reference readRun(const std::string &run)
{
  Reference reference;
  reference.trajectory = readTumTrajectory(run + "/trajectory.tum");
  if (reference.trajectory.empty())
    throw ioError("{}/trajectory.tum: no poses", run);
  reference.frames = reference.trajectory.size();
  reference.first_stamp_ns = reference.trajectory.front().stamp_ns;
  for (const TrunkRecord &trunk : readTrunks(run + "/trunks.csv"))
    reference.trunks.push_back({trunk.id, trunk.xy, trunk.radius, 0});
  TrunkVisibility expected;
  expected.is_expected = true;
  reference.visibility.assign(reference.trunks.size(), expected);
  return reference;
}

/// The trunks of the map, and the hypotheses that are none: what stood nearest to a missed trunk.
std::vector<TrunkRecord> readMap(const std::string &run)
{
  std::vector<TrunkRecord> map = readTrunks(run + "/trunks.csv");
  if (std::filesystem::exists(run + "/hypotheses.csv"))
    for (const TrunkRecord &hypothesis : readTrunks(run + "/hypotheses.csv"))
      map.push_back(hypothesis);
  return map;
}

bool isRun(const std::string &folder)
{
  return std::filesystem::exists(std::filesystem::path(folder) / "trajectory.tum");
}

std::vector<PosePair> pairsOf(const std::string &path, std::int64_t shift_ns, const Trajectory &truth)
{
  Trajectory estimate = readTumTrajectory(path);
  for (StampedPose &pose : estimate)
    pose.stamp_ns += shift_ns;
  std::vector<PosePair> pairs = pairPoses(estimate, truth);
  if (pairs.empty())
    throw badValue("{}: none of its stamps lies in the ground truth's; if the run was live, --align-time finds the "
                   "shift of its clock",
                   path);
  return pairs;
}

/// Of the positions in the plane as they were known online, by stamp.
std::map<std::int64_t, Eigen::Matrix2d> statedCovariances(const std::string &run, std::int64_t shift_ns)
{
  std::map<std::int64_t, Eigen::Matrix2d> covariances;
  for (const FrameTrace &frame : readFrames(run))
    covariances[frame.stamp_ns + shift_ns] = frame.covariance_xy;
  return covariances;
}

/// First frame on first frame, less the frames that a live run may have lost.
std::int64_t shiftOf(const std::string &path, const Reference &reference)
{
  const Trajectory estimate = readTumTrajectory(path);
  if (estimate.empty())
    throw ioError("{}: no poses", path);
  return motionShift(estimate, reference.trajectory, reference.first_stamp_ns - estimate.front().stamp_ns);
}
} // namespace

void writeRun(const std::string &run, const std::vector<TrunkRecord> &map, const Trajectory &smoothed)
{
  writeTrajectory(run + "/trajectory.tum", smoothed);
  writeTrunks(run + "/trunks.csv", map);
}

Evaluation evaluate(const std::string &run, const std::string &sequence, bool align_time)
{
  const auto in_run = [&](const char *name) { return (std::filesystem::path(run) / name).string(); };
  if (!std::filesystem::is_directory(run))
    throw ioError("{}: no such folder", run);

  Evaluation evaluation;
  evaluation.run = run;
  evaluation.sequence = sequence;
  evaluation.is_against_run = isRun(sequence);
  const Reference reference = evaluation.is_against_run ? readRun(sequence) : readSequence(sequence);
  evaluation.frames = reference.frames;
  std::int64_t shift_ns = 0;
  if (align_time) {
    shift_ns = shiftOf(in_run("trajectory.tum"), reference);
    evaluation.time_shift_s = static_cast<double>(shift_ns) * 1e-9;
  }

  const WorldReference world = worldOf(in_run("summary.json"));
  evaluation.reference = describe(world);
  const auto levelled = [&](const char *name) {
    std::vector<PosePair> pairs = pairsOf(in_run(name), shift_ns, reference.trajectory);
    if (world.gravity != GravitySource::odometry)
      levelHeights(pairs);
    return pairs;
  };
  const std::vector<PosePair> pairs = levelled("trajectory.tum");
  evaluation.smoothed = report(pairs);
  if (std::filesystem::exists(in_run("trajectory_online.tum"))) {
    const std::vector<PosePair> online = levelled("trajectory_online.tum");
    evaluation.online = report(online);
    if (world.scale == ScaleSource::odometry && std::filesystem::exists(in_run("frames.csv")))
      evaluation.online_nees_half =
          consistency(online, statedCovariances(run, shift_ns), align(online, Alignment::first_pose));
  }
  if (!reference.odometry.empty()) {
    std::vector<PosePair> odometry;
    for (const PosePair &pair : pairs)
      if (const auto wMb = interpolate(reference.odometry, pair.stamp_ns))
        odometry.push_back({pair.stamp_ns, *wMb, pair.truth});
    evaluation.odometry = report(odometry);
  }
  if (!reference.trunks.empty() || evaluation.is_against_run)
    evaluation.trunks =
        trunkMetrics(readMap(run), reference.trunks, reference.visibility, alignAll(pairs),
                     world.scale == ScaleSource::odometry ? Alignment::xy_yaw : Alignment::xy_yaw_scale);
  return evaluation;
}
} // namespace bole
