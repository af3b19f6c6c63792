// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/open_source.h>
#include <bole/pose.h>
#include <bole/vpRobotArDrone.h>

#include "ardrone/drone_link.h"
#include "geometry/failure.h"
#include "geometry/so3.h"
#include "input/steady_clock.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <thread>
#include <visp3/core/vpVelocityTwistMatrix.h>
#include <visp3/robot/vpRobotException.h>

namespace
{
constexpr std::chrono::milliseconds kPeriod{33}; // commands every 30 ms fly smoothly, says the manufacturer
constexpr int kRepeats = 3;                      // single datagrams get lost

} // namespace

struct vpRobotArDrone::State
{
  State(vpArDroneGrabber &g, const Options &o) : grabber(g), options(o), laws(o.laws) {}

  vpArDroneGrabber &grabber;
  const Options options;
  std::thread thread;
  std::atomic<bool> running{false};
  mutable std::mutex mutex; // guards all below
  bool in_air = false;
  int emergency_pulses = 0;
  Eigen::Vector4d wanted = Eigen::Vector4d::Zero(); // vx, vy, vz, wz of the body
  bool has_wanted = false;
  bole::FlightLaws laws;
  const char *law = "";
  Watchdog watchdog = Watchdog::idle;
  std::optional<bole::Pose> last_position;

  float share(double value) const
  {
    return static_cast<float>(std::clamp(value, -options.largest_share, options.largest_share));
  }

  static double now_s() { return 1e-9 * static_cast<double>(bole::steadyNowNs()); }

  void run()
  {
    while (running) {
      step();
      std::this_thread::sleep_for(kPeriod);
    }
  }

  void step()
  {
    const std::lock_guard<std::mutex> lock(mutex);
    bole::AtChannel &commands = grabber.getLink().commands();
    const auto body = grabber.getLink().body();
    if (emergency_pulses > 0) {
      commands.reference(false, emergency_pulses-- > 1); // a rising edge changes the state, so it must fall again
      return;
    }
    if (!in_air) {
      watchdog = Watchdog::idle;
      commands.reference(false, false);
      return;
    }
    std::optional<bole::OwnState> own;
    if (body)
      own = {body->wMb.t.head<2>(), bole::yawOf(body->wMb), body->velocity, body->height, body->battery};
    const bole::FlightOrder order = laws.apply(now_s(), has_wanted ? std::optional(wanted) : std::nullopt, own);
    law = order.law;
    if (order.kind == bole::FlightOrder::Kind::lands) {
      watchdog = Watchdog::lands;
      in_air = false;
      has_wanted = false;
      commands.reference(false, false);
      return;
    }
    commands.reference(true, false);
    const bool flies = order.kind == bole::FlightOrder::Kind::flies;
    watchdog = flies || !has_wanted ? Watchdog::content : Watchdog::hovers;
    if (!flies) {
      commands.move(false, 0, 0, 0, 0);
      return;
    }
    // Forward needs the nose down and leftward the left side down: both negative for the drone.
    const Eigen::Vector2d tilt = options.gain * (order.velocity.head<2>() - body->velocity.head<2>());
    commands.move(true, share(-tilt.y()), share(-tilt.x()), share(order.velocity.z() / options.largest_climb),
                  share(-order.velocity.w() / options.largest_turn));
  }

  void requireOpen() const
  {
    if (!running)
      throw vpRobotException(vpRobotException::notInitialized,
                             "the robot was not opened with the permission to fly: nothing was sent");
  }
};

vpRobotArDrone::Options::Options() : bMc(bole::forwardCamera().toVisp()) {}

void vpRobotArDrone::Options::validate() const
{
  laws.validate();
  bole::requireRange("gain", gain, 1e-9, 2);
  bole::requireRange("largest_share", largest_share, 1e-9, 1);
  bole::requireRange("largest_climb", largest_climb, 1e-9, 5);
  bole::requireRange("largest_turn", largest_turn, 1e-9, 7);
}

vpRobotArDrone::vpRobotArDrone(vpArDroneGrabber &grabber) : vpRobotArDrone(grabber, Options()) {}

vpRobotArDrone::vpRobotArDrone(vpArDroneGrabber &grabber, const Options &options)
{
  options.validate();
  nDof = 4;
  m_state = std::make_unique<State>(grabber, options);
}

vpRobotArDrone::~vpRobotArDrone() { close(); }

void vpRobotArDrone::open(Permission permission)
{
  if (permission != Permission::fly || m_state->running)
    return;
  m_state->grabber.getLink(); // throws when the grabber is not open
  m_state->running = true;
  m_state->thread = std::thread([this] { m_state->run(); });
}

void vpRobotArDrone::close()
{
  if (!m_state->running)
    return;
  m_state->running = false;
  m_state->thread.join();
  if (m_state->in_air)
    for (int i = 0; i < kRepeats; ++i)
      m_state->grabber.getLink().commands().reference(false, false);
  m_state->in_air = false;
}

bool vpRobotArDrone::isOpen() const { return m_state->running; }

void vpRobotArDrone::takeOff()
{
  m_state->requireOpen();
  const std::lock_guard<std::mutex> lock(m_state->mutex);
  m_state->in_air = true;
  m_state->has_wanted = false;
  m_state->laws.takeOff(m_state->now_s());
}

void vpRobotArDrone::land()
{
  m_state->requireOpen();
  const std::lock_guard<std::mutex> lock(m_state->mutex);
  m_state->in_air = false;
  m_state->has_wanted = false;
  m_state->grabber.getLink().commands().reference(false, false);
}

void vpRobotArDrone::hover()
{
  m_state->requireOpen();
  const std::lock_guard<std::mutex> lock(m_state->mutex);
  m_state->has_wanted = false;
  m_state->laws.renew(m_state->now_s());
}

void vpRobotArDrone::emergency()
{
  m_state->requireOpen();
  const std::lock_guard<std::mutex> lock(m_state->mutex);
  m_state->in_air = false;
  m_state->has_wanted = false;
  m_state->emergency_pulses = 2;
  m_state->grabber.getLink().commands().reference(false, true);
}

void vpRobotArDrone::trim()
{
  m_state->requireOpen();
  m_state->grabber.getLink().commands().trimFlat();
}

void vpRobotArDrone::setVelocity(const vpRobot::vpControlFrameType frame, const vpColVector &v)
{
  m_state->requireOpen();
  const Eigen::Vector4d wanted =
      bole::bodyVelocity(frame, v, m_state->options.bMc, getMaxTranslationVelocity(), getMaxRotationVelocity());
  const std::lock_guard<std::mutex> lock(m_state->mutex);
  m_state->wanted = wanted;
  m_state->has_wanted = true;
  m_state->laws.renew(m_state->now_s());
}

vpRobotArDrone::Watchdog vpRobotArDrone::watchdog() const
{
  const std::lock_guard<std::mutex> lock(m_state->mutex);
  return m_state->watchdog;
}

std::string vpRobotArDrone::brokenLaw() const
{
  const std::lock_guard<std::mutex> lock(m_state->mutex);
  return m_state->law;
}

void vpRobotArDrone::get_eJe(vpMatrix &jacobian) { jacobian = bole::quadrotorJacobian(); }

void vpRobotArDrone::get_fJe(vpMatrix &)
{
  throw vpRobotException(vpRobotException::notImplementedError, "a flying body has no fixed frame to be moved in");
}

void vpRobotArDrone::getPosition(const vpRobot::vpControlFrameType, vpColVector &q)
{
  const auto body = m_state->grabber.getLink().body();
  if (!body)
    throw vpRobotException(vpRobotException::communicationError, "no navdata for a second");
  q = bole::motionBetween({}, body->wMb);
}

void vpRobotArDrone::getDisplacement(const vpRobot::vpControlFrameType, vpColVector &q)
{
  const auto body = m_state->grabber.getLink().body();
  if (!body)
    throw vpRobotException(vpRobotException::communicationError, "no navdata for a second");
  const std::lock_guard<std::mutex> lock(m_state->mutex);
  q = bole::motionBetween(m_state->last_position.value_or(body->wMb), body->wMb);
  m_state->last_position = body->wMb;
}

void vpRobotArDrone::setPosition(const vpRobot::vpControlFrameType, const vpColVector &)
{
  throw vpRobotException(vpRobotException::notImplementedError, "an AR.Drone obeys velocities, not positions");
}

namespace bole
{
Eigen::Vector4d bodyVelocity(vpRobot::vpControlFrameType frame, const vpColVector &velocity,
                             const vpHomogeneousMatrix &bMc, double translation_max, double rotation_max)
{
  if (velocity.size() != 6)
    throw vpRobotException(vpRobotException::dimensionError, "velocity of %u numbers, must be 6", velocity.size());
  if (frame != vpRobot::CAMERA_FRAME && frame != vpRobot::REFERENCE_FRAME)
    throw vpRobotException(vpRobotException::wrongStateError, "frame, must be CAMERA_FRAME or REFERENCE_FRAME");
  for (unsigned i = 0; i < 6; ++i)
    if (!std::isfinite(velocity[i]))
      throw vpRobotException(vpRobotException::wrongStateError, "velocity %u is not finite", i);
  vpColVector most(6, translation_max);
  most[3] = most[4] = most[5] = rotation_max;
  vpColVector body = vpRobot::saturateVelocities(velocity, most, false);
  if (frame == vpRobot::CAMERA_FRAME)
    body = vpVelocityTwistMatrix(bMc) * body;
  return {body[0], body[1], body[2], body[5]};
}

vpMatrix quadrotorJacobian()
{
  vpMatrix jacobian(6, 4);
  jacobian[0][0] = jacobian[1][1] = jacobian[2][2] = jacobian[5][3] = 1;
  return jacobian;
}

vpColVector motionBetween(const Pose &from, const Pose &to)
{
  const Vector6d moved = to.minus(from);
  vpColVector q(6);
  for (unsigned i = 0; i < 6; ++i)
    q[i] = moved[i];
  return q;
}
} // namespace bole
