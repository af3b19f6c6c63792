// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/input/asl_source.h>
#include <bole/input/truth.h>
#include <bole/output/evaluation.h>
#include <bole/output/trunks_csv.h>

#include <filesystem>
#include <fmt/format.h>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
TrajectoryReport report(const std::vector<PosePair> &pairs)
{
  TrajectoryReport result;
  const Alignments alignments = alignAll(pairs);
  for (std::size_t a = 0; a < alignments.size(); ++a)
    result.absolute[a] = absoluteErrors(pairs, alignments[a]);
  result.scaled = at(alignments, Alignment::xy_yaw_scale);
  if (pairs.size() > 1)
    result.over_frame = relativeErrors(pairs, (pairs[1].stamp_ns - pairs[0].stamp_ns) * 1e-9);
  result.over_second = relativeErrors(pairs, 1);
  return result;
}

std::vector<PosePair> pairsOf(const std::string &path, const Trajectory &truth)
{
  std::vector<PosePair> pairs = pairPoses(readTumTrajectory(path), truth);
  if (pairs.empty())
    throw vpException(vpException::badValue,
                      fmt::format("{}: none of its stamps lies in the ground truth's", path));
  return pairs;
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
} // namespace

Evaluation evaluate(const std::string &run, const std::string &sequence)
{
  const auto in_run = [&](const char *name) {
    return (std::filesystem::path(run) / name).string();
  };
  if (!std::filesystem::is_directory(run))
    throw vpException(vpException::ioError, fmt::format("{}: no such folder", run));
  const AslSource source(sequence);
  if (source.truth().empty())
    throw vpException(
        vpException::ioError,
        fmt::format("{}: no ground truth (state_groundtruth_estimate0/data.csv)", sequence));

  Evaluation evaluation;
  evaluation.run = run;
  evaluation.sequence = sequence;
  evaluation.frames = source.size();
  const std::vector<PosePair> pairs = pairsOf(in_run("trajectory.tum"), source.truth());
  evaluation.smoothed = report(pairs);
  if (std::filesystem::exists(in_run("trajectory_online.tum")))
    evaluation.online = report(pairsOf(in_run("trajectory_online.tum"), source.truth()));
  if (!source.odometry().empty()) {
    std::vector<PosePair> odometry;
    for (const PosePair &pair : pairs)
      if (const auto wMb = interpolate(source.odometry(), pair.stamp_ns))
        odometry.push_back({pair.stamp_ns, *wMb, pair.truth});
    evaluation.odometry = report(odometry);
  }
  const std::vector<TruthTrunk> truth = readTruthTrunks(sequence);
  if (!truth.empty())
    evaluation.trunks = trunkMetrics(
        readTrunks(in_run("trunks.csv")), truth,
        trunkVisibility(truth, truePoses(source), source.bMc(), source.camera()), alignAll(pairs));
  return evaluation;
}
} // namespace bole
