// SPDX-License-Identifier: GPL-2.0-or-later
#include "trials/servo_trial.h"
#include "tasks/gap_and_slalom.h"
#include "tasks/trunk_task.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <memory>

namespace bole
{
namespace
{
constexpr double kFinal_s = 5; ///< final errors are those of the last seconds
constexpr double kBearing_deg = 0.5, kDistance = 0.03;
constexpr double kLeastGap = 1.2;  ///< true free width that another gap than the one set up must have [m]
constexpr double kSameTrunk = 0.6; ///< a trunk of the map this near to one of the truth is that one [m]

/// The trunk of the truth that stands where the map has the trunk \p id, both seen from the drone; -1: none.
int trueTrunk(const Forest &forest, const FrameReport &report, int id, const Pose &truth)
{
  const KnownTrunk *trunk = knownTrunk(report, id);
  if (!trunk)
    return -1;
  const Eigen::Vector3d seen = truth * (report.wMb.inverse() * trunk->trunk.axisAt(report.wMb.t.z()));
  double best = kSameTrunk;
  int found = -1;
  for (const SimulatedTrunk &candidate : forest.trunks) {
    const double off = (candidate.axisAt(seen.z() - candidate.foot.z()) - seen).head<2>().norm();
    if (off < best) {
      best = off;
      found = candidate.id;
    }
  }
  return found;
}

/// The truth about a trunk task: which trunk it flies by, and its errors.
class TrunkJudge
{
public:
  TrunkJudge(const Scenario &scenario, const TrunkTask &task, const Pose &bMc)
      : m_scenario(scenario), m_task(task), m_bMc(bMc)
  {
  }

  /// The trunk of the truth that stands where the task's stands, seen from the drone; -1: none.
  int trunk() const { return m_trunk; }

  ServoTask::Values operator()(const Pose &truth, const FrameReport &report)
  {
    if (m_task.target() < 0)
      return {};
    if (m_task.target() != m_target || m_trunk < 0) { // the first range may be far off: asks again
      m_target = m_task.target();
      m_trunk = trueTrunk(m_scenario.forest, report, m_target, truth);
    }
    if (m_trunk < 0)
      return {};
    const Trunk cylinder = m_scenario.forest.trunks[static_cast<std::size_t>(m_trunk)].cylinder();
    vpFeatureTrunk seen;
    const RelativeTrunk relative = relativeTrunk(truth, m_bMc, cylinder);
    if (!relative.isFinite())
      return {};
    seen.buildFrom(relative, cylinder.radius());
    const auto &asked = m_task.options();
    const double wanted = asked.ratio > 0 ? cylinder.radius() / asked.ratio : asked.distance;
    return {{"bearing [deg]", (seen.bearing() - asked.bearing) * 180 / M_PI},
            {"distance [%]", 100 * (seen.distance() / wanted - 1)},
            {"r/d [%]", 100 * (relative.ratio() / m_task.desiredRatio() - 1)}};
  }

private:
  const Scenario &m_scenario;
  const TrunkTask &m_task;
  Pose m_bMc;
  int m_target = -1, m_trunk = -1;
};

/// The truth about a gap: which trunks it flies between, as last seen from the drone: behind it the map may lose them.
class GapJudge
{
public:
  GapJudge(const Scenario &scenario, const GapTask &task) : m_scenario(scenario), m_task(task) {}

  /// Of the truth; -1: what the task takes for one is none.
  int left() const { return m_left; }
  int right() const { return m_right; }

  ServoTask::Values operator()(const Pose &truth, const FrameReport &report)
  {
    if (!m_task.gap())
      return {};
    follow(m_task.gap()->left, m_left_id, m_left, truth, report);
    follow(m_task.gap()->right, m_right_id, m_right, truth, report);
    return {};
  }

private:
  void follow(int id, int &last_id, int &found, const Pose &truth, const FrameReport &report)
  {
    const int now = trueTrunk(m_scenario.forest, report, id, truth);
    if (id != last_id || knownTrunk(report, id))
      found = now;
    last_id = id;
  }

  const Scenario &m_scenario;
  const GapTask &m_task;
  int m_left_id = -1, m_right_id = -1, m_left = -1, m_right = -1;
};

double valueOf(const ServoTask::Values &values, const char *name)
{
  for (const auto &[key, value] : values)
    if (key == name)
      return value;
  return kNotMeasured;
}

struct Moments
{
  double mean = kNotMeasured, rms = kNotMeasured;
};

/// Of a true error over the last seconds; NaN where it is not known in each of them.
Moments finalError(const LoopRecord &record, const char *name)
{
  double sum = 0, squares = 0;
  int count = 0;
  for (const LoopSample &sample : record.samples) {
    if (sample.time_s < record.samples.back().time_s - kFinal_s)
      continue;
    const double value = valueOf(sample.real, name);
    sum += value;
    squares += value * value;
    ++count;
  }
  return {sum / count, std::sqrt(squares / count)};
}

/// What a task is told of the drone: a command acts when the frame has come, half a step of the robot's loop and half
/// of the tilt's settling after it was heard.
ResponseOptions responseOf(const vpSimulatorArDrone::Options &robot)
{
  ResponseOptions response;
  response.delay = robot.video_delay_s + robot.body.command_delay + 0.03;
  return response;
}

TrunkTaskOptions trunkOptions(const ServoTrialOptions &options)
{
  TrunkTaskOptions task;
  task.response = responseOf(options.robot);
  task.distance = options.distance;
  task.ratio = options.ratio;
  task.search_s = options.loop.search_most_s;
  if (options.scenario.kind == ServoKind::circle) {
    task.speed = options.speed > 0 ? options.speed : 0.5;
    task.ratio = options.ratio > 0 ? options.ratio : options.scenario.ratio;
  }
  return task;
}

std::unique_ptr<ServoTask> makeTask(const ServoTrialOptions &options, const Pose &bMc)
{
  if (options.scenario.kind == ServoKind::gap) {
    GapTaskOptions gap;
    gap.search_s = options.loop.search_most_s;
    gap.response = responseOf(options.robot);
    if (options.speed > 0)
      gap.way.speed = options.speed;
    return std::make_unique<GapTask>(gap);
  }
  if (options.scenario.kind == ServoKind::slalom) {
    SlalomTaskOptions slalom;
    slalom.length = options.scenario.length;
    slalom.response = responseOf(options.robot);
    if (options.speed > 0)
      slalom.way.speed = options.speed;
    return std::make_unique<SlalomTask>(slalom);
  }
  return std::make_unique<TrunkTask>(bMc, trunkOptions(options));
}

Perception makePerception(const ServoTrialOptions &options, const vpSimulatorArDrone &robot, const Scenario &scenario)
{
  const Forest &forest = scenario.forest;
  if (options.perception == PerceptionKind::truth)
    return truthPerception(robot.camera(), robot.bMc(), forest, options.missing, scenario.askedFor());
  if (options.perception == PerceptionKind::truth_map)
    return truthMapPerception(robot.camera(), robot.bMc(), forest, TrackerKind::trunk);
  if (options.perception == PerceptionKind::visp_edges)
    return truthMapPerception(robot.camera(), robot.bMc(), forest, TrackerKind::visp_generic_edge);
  return realPerception(robot.camera(), robot.bMc(), options.pipeline);
}

/// How far round the trunk the drone went while it servoed [deg].
double turnedRound(const LoopRecord &record, const SimulatedTrunk &trunk)
{
  double turned = 0, last = kNotMeasured;
  for (const LoopSample &sample : record.samples) {
    if (sample.phase != TaskPhase::servoing)
      continue;
    const Eigen::Vector2d w = (sample.truth.t - trunk.axisAt(sample.truth.t.z() - trunk.foot.z())).head<2>();
    const double angle = std::atan2(w.y(), w.x());
    turned += std::isnan(last) ? 0 : std::remainder(angle - last, 2 * M_PI);
    last = angle;
  }
  return std::abs(turned) * 180 / M_PI;
}

void judgeTrunk(ServoTrialResult &result, const ServoTrialOptions &options, const Scenario &scenario, int trunk)
{
  const Moments bearing = finalError(result.record, "bearing [deg]"),
                distance = finalError(result.record, "distance [%]");
  result.bearing_rms_deg = bearing.rms;
  result.distance_rms = distance.rms / 100;
  result.distance_mean = distance.mean / 100;
  result.ratio_rms = finalError(result.record, "r/d [%]").rms / 100;
  const bool is_right = trunk >= 0;
  if (is_right)
    result.turned_deg = turnedRound(result.record, scenario.forest.trunks[static_cast<std::size_t>(trunk)]);
  const bool is_round = options.scenario.kind != ServoKind::circle || result.turned_deg >= 360;
  if (result.record.servoing_from_s < 0)
    result.outcome = "no trunk found";
  else if (!is_right)
    result.outcome = "flew by what is no trunk";
  else if (!(result.bearing_rms_deg <= kBearing_deg && result.distance_rms <= kDistance))
    result.outcome = std::isnan(result.bearing_rms_deg) ? "lost the trunk" : "errors too large";
  else
    result.outcome = is_round ? "" : "not once round";
}

/// Whether the path crossed the line between the two trunks.
bool passedBetween(const LoopRecord &record, const SimulatedTrunk &left, const SimulatedTrunk &right)
{
  for (std::size_t k = 1; k < record.samples.size(); ++k) {
    const Eigen::Vector3d a = record.samples[k - 1].truth.t, b = record.samples[k].truth.t;
    const Eigen::Vector2d l = left.axisAt(b.z() - left.foot.z()).head<2>(),
                          r = right.axisAt(b.z() - right.foot.z()).head<2>();
    const Eigen::Vector2d across = r - l, normal(-across.y(), across.x());
    const double side_a = normal.dot(a.head<2>() - l), side_b = normal.dot(b.head<2>() - l);
    const double place = across.dot(b.head<2>() - l) / across.squaredNorm();
    if (side_a * side_b < 0 && place > 0 && place < 1)
      return true;
  }
  return false;
}

/// Speeds from where it leaves to where it arrives.
void judgeSlalom(ServoTrialResult &result)
{
  const LoopRecord &record = result.record;
  const LoopSample *first = nullptr, *last = nullptr;
  double path = 0;
  for (const LoopSample &sample : record.samples) {
    if (sample.phase != TaskPhase::servoing)
      continue;
    if (last)
      path += (sample.truth.t - last->truth.t).head<2>().norm();
    first = first ? first : &sample;
    last = &sample;
  }
  result.progress = record.samples.empty() ? 0 : record.samples.back().truth.t.x();
  if (first != last) {
    const double seconds = last->time_s - first->time_s;
    result.mean_speed = path / seconds;
    result.speed_along = (last->truth.t - first->truth.t).x() / seconds;
  }
  result.outcome = record.is_finished ? "" : fmt::format("stopped at {:.1f} m", result.progress);
}

/// Free way between the bark of two trunks at the height \p z of the world [m].
double widthBetween(const SimulatedTrunk &one, const SimulatedTrunk &other, double z)
{
  const double h = z - one.foot.z(), other_h = z - other.foot.z();
  return (one.axisAt(h) - other.axisAt(other_h)).head<2>().norm() - one.radiusAt(h) - other.radiusAt(other_h);
}

/// The task is not told which gap is set up: any that is as wide as those asked for will do.
void judgeGap(ServoTrialResult &result, const Scenario &scenario, const GapTask &task, const GapJudge &judge)
{
  const LoopRecord &record = result.record;
  const auto &trunks = scenario.forest.trunks;
  if (record.servoing_from_s < 0) {
    result.outcome = "no gap found";
    return;
  }
  if (!record.is_finished || !task.gap()) {
    result.outcome = "did not get through";
    return;
  }
  const LoopSample &last = record.samples.back();
  const int left = judge.left(), right = judge.right();
  if (left < 0 || right < 0 || left == right) {
    result.outcome = "flew by what is no trunk";
    return;
  }
  const SimulatedTrunk &one = trunks[static_cast<std::size_t>(left)], &other = trunks[static_cast<std::size_t>(right)];
  result.gap_width = widthBetween(one, other, last.truth.t.z());
  result.is_other_gap = std::minmax(left, right) != std::minmax(scenario.left, scenario.right);
  if (!passedBetween(record, one, other))
    result.outcome = "did not get through";
  else if (result.is_other_gap && result.gap_width < kLeastGap)
    result.outcome = "gap too narrow";
}

void judgeFault(ServoTrialResult &result)
{
  const LoopSample *first = nullptr;
  for (const LoopSample &sample : result.record.samples) {
    if (!sample.is_spoilt)
      continue;
    first = first ? first : &sample;
    if (std::isnan(result.hover_after_s) && sample.is_hovering)
      result.hover_after_s = sample.time_s - first->time_s;
    result.drift = (sample.truth.t - first->truth.t).norm();
  }
}
} // namespace

vpSimulatorArDrone::Options ServoTrialOptions::defaultRobot()
{
  vpSimulatorArDrone::Options robot;
  robot.gain = 0.6;
  robot.renderer.samples_per_pixel = 2;
  return robot;
}

Options ServoTrialOptions::defaultPipeline()
{
  Options pipeline;
  pipeline.stages.servoing = true;
  pipeline.map.lag = 5;
  return pipeline;
}

ServoTrialResult runServoTrial(const ServoTrialOptions &options, const LoopWatcher &watcher)
{
  ServoTrialResult result;
  result.seed = options.scenario.seed;
  ScenarioOptions asked = options.scenario;
  if (options.ratio > 0)
    asked.ratio = options.ratio;
  const Scenario scenario = makeScenario(asked);
  vpSimulatorArDrone::Options settings = options.robot;
  settings.setSeed(options.scenario.seed);
  vpSimulatorArDrone robot(scenario.forest, settings);
  const Perception perception = makePerception(options, robot, scenario);
  const std::unique_ptr<ServoTask> task = makeTask(options, robot.bMc());

  const auto fly = [&](const Judge &judge) {
    result.record = runClosedLoop(robot, perception, *task, options.loop, judge, watcher);
    result.duration_s = result.record.samples.empty() ? 0 : result.record.samples.back().time_s;
  };
  if (auto *trunk_task = dynamic_cast<TrunkTask *>(task.get())) {
    TrunkJudge judge(scenario, *trunk_task, robot.bMc());
    fly(std::ref(judge));
    judgeTrunk(result, options, scenario, judge.trunk());
  }
  else if (const auto *gap_task = dynamic_cast<const GapTask *>(task.get())) {
    GapJudge judge(scenario, *gap_task);
    fly(std::ref(judge));
    judgeGap(result, scenario, *gap_task, judge);
  }
  else {
    fly({});
    judgeSlalom(result);
  }
  if (result.record.is_contact)
    result.outcome = "touched a trunk";
  result.is_success = result.outcome.empty();
  if (result.record.servoing_from_s >= 0)
    result.servoing_from_s = result.record.servoing_from_s;
  result.least_clearance = robot.leastClearance();
  result.median_loop_ms = result.record.loopQuantile_ms(0.5);
  result.p95_loop_ms = result.record.loopQuantile_ms(0.95);
  judgeFault(result);
  result.trunks = scenario.forest.trunks;
  return result;
}
} // namespace bole
