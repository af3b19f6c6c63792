// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/vpSimulatorArDrone.h"
#include "support/text.h"
#include "support/units.h"
#include <bole/pose.h>
#include <bole/vpRobotArDrone.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <visp3/robot/vpRobotException.h>

namespace
{
constexpr double kTick = 0.005;     ///< of the gyro and of the motion [s]
constexpr int kTicksPerCommand = 6; ///< the velocity loop, as vpRobotArDrone's

std::int64_t nanoseconds(double seconds) { return std::llround(1e9 * seconds); }
} // namespace

struct vpSimulatorArDrone::State
{
  State(const bole::Forest &f, const Options &o)
      : options(o),
        forest(f),
        body(o.body, {0, 0}, 0, f.terrain.height(0, 0)),
        imu(o.sensors),
        filter(o.sensors),
        bMc(bole::Pose::fromVisp(o.bMc)),
        laws(o.laws),
        last(body.pose())
  {
    if (options.has_images)
      renderer.emplace(forest, options.renderer);
  }

  const Options options;
  bole::Forest forest;
  bole::Quadrotor body;
  bole::SimulatedImu imu;
  bole::PoseFilter filter;
  std::optional<bole::ForestRenderer> renderer;
  const bole::Pose bMc;

  bool is_open = false, in_air = false, has_wanted = false;
  Eigen::Vector4d wanted = Eigen::Vector4d::Zero(); // vx, vy, vz, wz of the body
  bole::FlightLaws laws;
  const char *law = "";
  bool navdata_are_lost = false;
  Eigen::Vector2d reckoned = Eigen::Vector2d::Zero(); // by the drone's own velocity, from where it stood [m]
  Watchdog watchdog = Watchdog::idle;

  long ticks = 0;
  bole::Pose last; // of the body, one tick ago
  std::vector<bole::GyroSample> gyro;
  std::size_t frames = 0;
  double next_exposure = 0;
  std::optional<bole::Pose> reported, displaced; // by the pose filter
  double least_clearance = std::numeric_limits<double>::infinity();

  double time() const { return kTick * static_cast<double>(ticks); }

  double share(double value) const { return std::clamp(value, -options.largest_share, options.largest_share); }

  /// vpRobotArDrone's loop, one step of it.
  void control()
  {
    bole::QuadrotorCommand command;
    reckoned += kTicksPerCommand * kTick * (Eigen::Rotation2Dd(bole::yawOf(body.pose())) * body.measuredVelocity());
    watchdog = Watchdog::idle;
    law = "";
    bole::FlightOrder order;
    if (in_air) {
      order = laws.apply(time(), has_wanted ? std::optional(wanted) : std::nullopt, own());
      law = order.law;
      if (order.kind == bole::FlightOrder::Kind::lands) {
        watchdog = Watchdog::lands;
        in_air = has_wanted = false;
      }
    }
    if (in_air) {
      const bool flies = order.kind == bole::FlightOrder::Kind::flies;
      watchdog = flies || !has_wanted ? Watchdog::content : Watchdog::hovers;
      command.is_flying = true;
      command.is_hovering = !flies;
      const Eigen::Vector2d tilt = options.gain * (order.velocity.head<2>() - body.measuredVelocity());
      command.tilt = {share(tilt.x()), share(tilt.y())};
      command.climb = options.largest_climb * share(order.velocity.z() / options.largest_climb);
      command.turn = options.largest_turn * share(order.velocity.w() / options.largest_turn);
    }
    body.command(command);
  }

  /// Navdata, as the robot's loop gets them.
  std::optional<bole::OwnState> own() const
  {
    if (navdata_are_lost)
      return std::nullopt;
    const bole::Pose wMb = body.pose();
    const double height = wMb.t.z() - forest.terrain.height(wMb.t.x(), wMb.t.y());
    const Eigen::Vector2d level = body.measuredVelocity();
    return bole::OwnState{reckoned,
                          bole::yawOf(wMb),
                          {level.x(), level.y(), body.velocity().z()},
                          height,
                          std::max(0.0, 1 - time() / options.battery_s)};
  }

  void tick()
  {
    if (ticks % kTicksPerCommand == 0)
      control();
    last = body.pose();
    body.step(0.5 * kTick);
    body.step(0.5 * kTick);
    ++ticks;
    const bole::Pose now = body.pose();
    const Eigen::Vector3d rate = bole::logSo3(last.R.transpose() * now.R) / kTick;
    // the mean of the tick stands in its middle
    gyro.push_back(imu.measure(nanoseconds(time() - 0.5 * kTick), now.R, rate, body.acceleration()));
    if (body.isInAir())
      least_clearance = std::min(least_clearance, forest.distanceToBark(now.t));
  }

  /// Time passes until \p t; the pose there.
  bole::Pose poseAt(double t)
  {
    while (time() < t - 1e-9)
      tick();
    const bole::Pose now = body.pose();
    const double back = std::clamp((time() - t) / kTick, 0.0, 1.0);
    return now.plus(back * last.minus(now));
  }

  void requireOpen() const
  {
    if (!is_open)
      throw vpRobotException(vpRobotException::notInitialized,
                             "the robot was not opened with the permission to fly: nothing was sent");
  }

  const bole::Pose &position() const
  {
    if (!reported)
      throw vpRobotException(vpRobotException::communicationError, "no frame yet: the pose filter has said nothing");
    return *reported;
  }
};

vpSimulatorArDrone::Options::Options() { renderer.samples_per_pixel = 3; }

void vpSimulatorArDrone::Options::setSeed(std::uint64_t seed) { body.seed = sensors.seed = renderer.noise_seed = seed; }

void vpSimulatorArDrone::Options::validate() const
{
  vpRobotArDrone::Options::validate();
  bole::requireRange("rate_hz", rate_hz, 1, 60);
  bole::requireRange("battery_s", battery_s, 1, 1e5);
  bole::requireRange("exposure_s", exposure_s, 0, 0.1);
  bole::requireRange("video_delay_s", video_delay_s, 0, 1);
  if (renderer.camera.distortion != bole::Distortion::none)
    throw bole::badValue("distortion, must be none: frames are taken as a pinhole's");
  body.validate();
  renderer.validate();
}

vpSimulatorArDrone::vpSimulatorArDrone(const bole::Forest &forest, const Options &options)
{
  options.validate();
  nDof = 4;
  m_state = std::make_unique<State>(forest, options);
}

vpSimulatorArDrone::~vpSimulatorArDrone() = default;

void vpSimulatorArDrone::open(Permission permission) { m_state->is_open |= permission == Permission::fly; }

void vpSimulatorArDrone::close() { m_state->in_air = m_state->has_wanted = m_state->is_open = false; }

bool vpSimulatorArDrone::isOpen() const { return m_state->is_open; }

void vpSimulatorArDrone::takeOff()
{
  m_state->requireOpen();
  m_state->in_air = true;
  m_state->has_wanted = false;
  m_state->laws.takeOff(m_state->time());
}

void vpSimulatorArDrone::land()
{
  m_state->requireOpen();
  m_state->in_air = m_state->has_wanted = false;
}

void vpSimulatorArDrone::hover()
{
  m_state->requireOpen();
  m_state->has_wanted = false;
  m_state->laws.renew(m_state->time());
}

void vpSimulatorArDrone::emergency()
{
  m_state->requireOpen();
  m_state->in_air = m_state->has_wanted = false;
  const bole::Pose wMb = m_state->body.pose();
  m_state->body = bole::Quadrotor(m_state->options.body, wMb.t.head<2>(), std::atan2(wMb.R(1, 0), wMb.R(0, 0)),
                                  m_state->forest.terrain.height(wMb.t.x(), wMb.t.y()));
}

void vpSimulatorArDrone::trim() { m_state->requireOpen(); }

void vpSimulatorArDrone::setVelocity(const vpRobot::vpControlFrameType frame, const vpColVector &v)
{
  m_state->requireOpen();
  m_state->wanted =
      bole::bodyVelocity(frame, v, m_state->options.bMc, getMaxTranslationVelocity(), getMaxRotationVelocity());
  m_state->has_wanted = true;
  m_state->laws.renew(m_state->time());
}

vpSimulatorArDrone::Watchdog vpSimulatorArDrone::watchdog() const { return m_state->watchdog; }
std::string vpSimulatorArDrone::brokenLaw() const { return m_state->law; }
void vpSimulatorArDrone::loseNavdata(bool are_lost) { m_state->navdata_are_lost = are_lost; }

void vpSimulatorArDrone::get_eJe(vpMatrix &jacobian) { jacobian = bole::quadrotorJacobian(); }

void vpSimulatorArDrone::get_fJe(vpMatrix &)
{
  throw vpRobotException(vpRobotException::notImplementedError, "a flying body has no fixed frame to be moved in");
}

void vpSimulatorArDrone::getPosition(const vpRobot::vpControlFrameType, vpColVector &q)
{
  q = bole::motionBetween({}, m_state->position());
}

void vpSimulatorArDrone::getDisplacement(const vpRobot::vpControlFrameType, vpColVector &q)
{
  const bole::Pose now = m_state->position();
  q = bole::motionBetween(m_state->displaced.value_or(now), now);
  m_state->displaced = now;
}

void vpSimulatorArDrone::setPosition(const vpRobot::vpControlFrameType, const vpColVector &)
{
  throw vpRobotException(vpRobotException::notImplementedError, "an AR.Drone obeys velocities, not positions");
}

bool vpSimulatorArDrone::next(bole::Frame &frame)
{
  State &state = *m_state;
  const double period = 1 / state.options.rate_hz, half = 0.5 * state.options.exposure_s;
  while (state.next_exposure - half < state.time()) // time passed without pictures
    state.next_exposure += period;
  const double t = state.next_exposure;
  const bole::Pose open = state.poseAt(t - half), middle = state.poseAt(t), shut = state.poseAt(t + half);
  bole::RenderedFrame rendered;
  if (state.renderer)
    state.renderer->render(open * state.bMc, shut * state.bMc, rendered);

  frame.stamp_ns = nanoseconds(t);
  frame.index = state.frames++;
  frame.status = bole::FrameStatus::ok;
  frame.message.clear();
  frame.image = rendered.image;
  state.reported = state.filter.report(frame.stamp_ns, middle);
  frame.wMb_odometry = state.reported;
  frame.wMb_truth = middle;
  const auto later = std::find_if(state.gyro.begin(), state.gyro.end(),
                                  [&](const bole::GyroSample &sample) { return sample.stamp_ns > frame.stamp_ns; });
  frame.gyro.assign(state.gyro.begin(), later);
  state.gyro.erase(state.gyro.begin(), later);
  state.poseAt(t + std::max(half, state.options.video_delay_s));
  state.next_exposure += period;
  return true;
}

bole::PinholeCamera vpSimulatorArDrone::camera() const { return m_state->options.renderer.camera.pinhole; }
bole::Pose vpSimulatorArDrone::bMc() const { return m_state->bMc; }

void vpSimulatorArDrone::advance(double seconds)
{
  bole::requireRange("seconds", seconds, 0, 3600);
  m_state->poseAt(m_state->time() + seconds);
}

double vpSimulatorArDrone::time() const { return m_state->time(); }
bool vpSimulatorArDrone::isInAir() const { return m_state->body.isInAir(); }
const bole::Quadrotor &vpSimulatorArDrone::body() const { return m_state->body; }
double vpSimulatorArDrone::leastClearance() const { return m_state->least_clearance; }
