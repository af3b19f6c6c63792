// SPDX-License-Identifier: GPL-2.0-or-later
#include "trials/closed_loop.h"

#include "support/text.h"
#include "support/units.h"

namespace bole
{
namespace
{
constexpr double kTakeOff_s = 4;   ///< until the height is reached and the body at rest
constexpr double kRest_s = 2;      ///< flown on after the task is done
constexpr double kContact = 0.28;  ///< body's origin to bark that is a contact: ends the flight [m]
constexpr double kMostSpeed = 1.5; ///< given to the robot [m/s]
constexpr double kMostTurn = 1;    ///< given to the robot [rad/s]
constexpr double kMapKept = 8;     ///< of the record [m]

void takeOff(vpSimulatorArDrone &robot)
{
  robot.setMaxTranslationVelocity(kMostSpeed);
  robot.setMaxRotationVelocity(kMostTurn);
  robot.open(vpSimulatorArDrone::Permission::fly);
  robot.takeOff();
  for (double t = 0; t < kTakeOff_s; t += 0.1) {
    robot.hover();
    robot.advance(0.1);
  }
}

void give(vpSimulatorArDrone &robot, const TaskCommand &command)
{
  if (command.is_hovering)
    return robot.hover();
  vpColVector v(6, 0.0);
  v[0] = command.velocity(0), v[1] = command.velocity(1), v[2] = command.velocity(2), v[5] = command.velocity(3);
  robot.setVelocity(vpRobot::REFERENCE_FRAME, v);
}
} // namespace

void LoopOptions::validate() const
{
  requireRange("duration_s", duration_s, 1, 3600);
  requireRange("search_most_s", search_most_s, 1, 3600);
  fault.validate();
}

double LoopRecord::loopQuantile_ms(double share) const
{
  std::vector<double> ms;
  for (const LoopSample &sample : samples)
    ms.push_back(sample.loop_ms);
  return quantileOf(std::move(ms), share);
}

LoopRecord runClosedLoop(vpSimulatorArDrone &robot, const Perception &perception, ServoTask &task,
                         const LoopOptions &options, const Judge &judge, const LoopWatcher &watcher)
{
  options.validate();
  LoopRecord record;
  FaultInjector injector(options.fault);
  takeOff(robot);
  const double begin_s = robot.time();
  double rest_from_s = -1;
  for (;;) {
    Frame frame;
    if (!robot.next(frame))
      break;
    LoopSample sample;
    sample.time_s = secondsOf(frame.stamp_ns) - begin_s;
    sample.truth = *frame.wMb_truth;
    frame.wMb_truth.reset(); // nobody below may see it
    const double servoing_s = record.servoing_from_s < 0 ? -1 : sample.time_s - record.servoing_from_s;
    sample.is_spoilt = injector.apply(frame, servoing_s);

    const double start_ms = processorTime_ms();
    const FrameReport report = perception(frame, sample.truth);
    const TaskCommand command = task.step(report);
    sample.loop_ms = processorTime_ms() - start_ms;
    give(robot, command);

    if (record.servoing_from_s < 0 && task.phase() == TaskPhase::servoing)
      record.servoing_from_s = sample.time_s;
    sample.phase = task.phase();
    sample.is_lost = task.isLost();
    sample.is_hovering = command.is_hovering;
    sample.frame_status = frame.status;
    sample.estimate = report.wMb;
    sample.command = command.velocity;
    sample.speed = robot.body().velocity().head<2>().norm();
    sample.clearance = robot.leastClearance(); // least so far, of every 5 ms
    sample.believed = task.errors();
    sample.reason = command.reason;
    for (const KnownTrunk &trunk : report.map)
      if ((trunk.trunk.axisAt(report.wMb.t.z()) - report.wMb.t).head<2>().norm() < kMapKept)
        sample.map.push_back(trunk);
    if (judge)
      sample.real = judge(sample.truth, report);
    record.samples.push_back(sample);
    record.verdicts = report.verdicts;

    record.is_contact = robot.leastClearance() < kContact;
    record.is_finished = task.phase() == TaskPhase::done;
    const bool is_over = task.phase() == TaskPhase::done || task.phase() == TaskPhase::failed;
    if (is_over && rest_from_s < 0)
      rest_from_s = sample.time_s;
    if (watcher && !watcher(frame, report, sample))
      break;
    if (record.is_contact || (is_over && sample.time_s > rest_from_s + kRest_s) || servoing_s > options.duration_s ||
        (record.servoing_from_s < 0 && sample.time_s > options.search_most_s))
      break;
  }
  return record;
}
} // namespace bole
