// SPDX-License-Identifier: GPL-2.0-or-later
// What the odometry says, against itself and against gravity and the direction of flight.
#include "motion/sensor_monitor.h"

#include "geometry/constants.h"
#include "geometry/median.h"
#include "motion/accelerometer.h"
#include "motion/gravity.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
using Eigen::Vector3d;

namespace
{
constexpr double kJump = 0.3;            // of the odometry between two frames beyond what its velocity explains [m]
constexpr double kMostAcceleration = 10; // [m/s^2]
constexpr double kNoiseFactor = 2.5;     // scatter of the odometry over what odometry::kWalk says
constexpr double kAskew = 0.1;           // of a constant rotation between odometry and camera [rad]
constexpr double kTogether = 3;          // comparisons that overlap
} // namespace

/// Checks the steps of the odometry from frame to frame.
void SensorMonitor::checkSteps(const Frame &frame, const std::vector<RelativeMotion> &motions)
{
  const double time_s = secondsOf(frame.stamp_ns);
  bool &is_wrong = of(Sensor::odometry).is_wrong_now;
  if (!frame.wMb_odometry) {
    if (m_had_odometry && secondsOf(frame.stamp_ns - m_last_odometry_ns) > kSilence_s)
      raise(Sensor::odometry, "ended", secondsOf(m_last_odometry_ns),
            fmt::format("odometry: nothing since {:.1f} s", secondsOf(m_last_odometry_ns)), Lasts::until_agree);
    m_steps.clear();
    return;
  }
  if (!m_had_odometry)
    checkHeight(frame.wMb_odometry->t.z(), time_s);
  m_had_odometry = true;
  m_last_odometry_ns = frame.stamp_ns;
  Step step;
  step.stamp_ns = frame.stamp_ns;
  step.wMb = *frame.wMb_odometry;
  for (const RelativeMotion &motion : motions)
    if (motion.points.hasDirection())
      step.parallax_px = std::max(step.parallax_px, motion.points.parallax_px);
  if (!m_steps.empty()) {
    const Step &before = m_steps.back();
    const double dt = std::max(1e-3, secondsOf(step.stamp_ns - before.stamp_ns));
    const Vector3d moved = step.wMb.t - before.wMb.t;
    step.is_held = step.parallax_px > 1 && step.wMb.t == before.wMb.t && step.wMb.R == before.wMb.R;
    is_wrong |= step.is_held || before.is_held; // the step after a pause makes up for it
    step.believed = before.believed;
    if (before.believed) { // neither side of a jump tells a velocity: what follows is judged by that before it
      const Velocity &expected = *before.believed;
      const Eigen::Vector2d change = (moved - dt * expected.mean).head<2>();
      const double unknown = std::max(1.0, dt / expected.duration), // of a velocity over a moment
          age = secondsOf(step.stamp_ns - expected.until_ns);
      step.is_jump = change.norm() > kJump * unknown + kMostAcceleration * dt * age;
      if (!step.is_jump)
        step.acceleration = change / (dt * dt);
      if (before.acceleration && step.acceleration) {
        constexpr double kJerk = 20; // that a small drone reaches for long [m/s^3]
        const double walked = 6 * std::pow(odometry::kWalk, 2) * dt + std::pow(kJerk * dt * dt * dt, 2);
        step.scatter = 0.5 * (change - dt * dt * *before.acceleration).squaredNorm() / walked;
      }
      is_wrong |= step.is_jump;
      if (step.is_jump)
        raiseJump(change.norm(), time_s);
    }
    if (!step.is_jump && !step.is_held && !before.is_held)
      step.believed = Velocity{moved / dt, step.stamp_ns, dt};
  }
  m_steps.push_back(step);
  checkStandingStill(time_s);
  checkScatter();
}

/// Checks the height at which the flight begins: trunks are looked for above the ground, z = 0.
void SensorMonitor::checkHeight(double height, double time_s)
{
  constexpr double kLow = -2,
                   kHigh = 10; // [m]: it may count from the body at take-off, above the crowns no trunk is seen
  if (height < kLow || height > kHigh)
    raise(Sensor::odometry, "height", time_s,
          fmt::format("odometry: its heights begin at {:.1f} m, must be over the ground (over the sea?)", height));
}

/// A filter may jump where it is corrected; one that goes on jumping tells no motion.
void SensorMonitor::raiseJump(double extent, double time_s)
{
  constexpr std::ptrdiff_t kTooMany = 3; // before this one, within the memory
  const auto isJump = [](const Step &step) { return step.is_jump; };
  const auto first = std::find_if(m_steps.begin(), m_steps.end(), isJump);
  if (std::count_if(first, m_steps.end(), isJump) < kTooMany)
    raise(Sensor::odometry, "jump", time_s, fmt::format("odometry: jump of {:.1f} m at {:.1f} s", extent, time_s),
          Lasts::no);
  else
    raise(Sensor::odometry, "noise", secondsOf(first->stamp_ns), "odometry: jumps again and again");
}

/// Checks for an odometry that stays where it is while the points move.
void SensorMonitor::checkStandingStill(double time_s)
{
  double since_s = time_s;
  int frames = 0;
  bool moves = false;
  for (auto step = m_steps.rbegin(); step + 1 != m_steps.rend(); ++step) {
    if ((step->wMb.t - (step + 1)->wMb.t).norm() > 1e-6)
      break;
    ++frames;
    moves = moves || step->parallax_px > 1;
    since_s = secondsOf((step + 1)->stamp_ns);
  }
  if (frames >= 3 && moves)
    raise(Sensor::odometry, "stuck", since_s, fmt::format("odometry: frozen since {:.1f} s", since_s),
          Lasts::until_agree);
}

/// Checks the positions of the odometry for white noise, by the change from step to step.
void SensorMonitor::checkScatter()
{
  constexpr std::size_t kLeast = 12; // steps
  constexpr double kLeast_s = 1.05;
  std::vector<double> scatters;
  auto step = m_steps.rbegin();
  for (; step != m_steps.rend(); ++step) {
    if (scatters.size() >= kLeast && secondsOf(m_steps.back().stamp_ns - step->stamp_ns) > kLeast_s)
      break;
    scatters.push_back(step->scatter);
  }
  if (scatters.size() >= kLeast && medianOf(scatters) > std::pow(kNoiseFactor, 2))
    raise(Sensor::odometry, "noise", secondsOf((step - 1)->stamp_ns),
          "odometry: its positions scatter from frame to frame");
}

/// Checks for a constant rotation between the direction of flight by the odometry and by the points.
void SensorMonitor::checkDirection()
{
  constexpr std::size_t kLeast = 24; // comparisons
  std::vector<double> x, y, z;
  double information = 0;
  for (const Comparison &c : m_comparisons) {
    if (c.askew_variance <= 0)
      continue;
    x.push_back(c.askew.x());
    y.push_back(c.askew.y());
    z.push_back(c.askew.z());
    information += 1 / c.askew_variance;
  }
  if (x.size() < kLeast)
    return;
  const Vector3d askew(medianOf(x), medianOf(y), medianOf(z));
  const double sigma = std::sqrt(1.6 * kTogether / information); // 1.6: of a median
  if (askew.norm() > std::max(kAskew, 5 * sigma))
    raise(Sensor::odometry, "direction", secondsOf(m_comparisons.front().a_ns),
          fmt::format("odometry: stands {:.0f} degrees askew to the camera", askew.norm() / kDegree));
}

/// Gravity by the accelerometer against that by the odometry's roll and pitch. The accelerometer is wrong where the
/// length of the force is, and where a bias explains the difference and the points do not show the odometry turned.
void SensorMonitor::checkGravity()
{
  constexpr double kLeast_s = 1.8, kDecided_s = 3.8; // of the memory, and where it needs the points
  constexpr double kLimit = 0.06 * kGravity;         // [m/s^2]: what roll, pitch and a bias that is usual amount to
  constexpr double kMostSigma = 1;                   // beyond it the limit does not grow [m/s^2]
  constexpr double kMostBias = 3 * accelerometer::kFaultSigma;
  const auto isOdd = [](const Step &step) { return step.is_held || step.is_jump; };
  const double remembered_s = m_steps.empty() ? 0 : secondsOf(m_steps.back().stamp_ns - m_steps.front().stamp_ns);
  if (remembered_s < kLeast_s || !trusts(Sensor::gyro) || std::any_of(m_steps.begin(), m_steps.end(), isOdd))
    return; // force and velocity would be of different times; what beside it is wrong is no witness
  Trajectory poses;
  for (const Step &step : m_steps)
    poses.push_back({step.stamp_ns, step.wMb});
  const auto gravity = compareGravity(poses, m_samples);
  if (!gravity)
    return;
  const double off = gravity->off.norm(), limit = kLimit + 2 * std::min(kMostSigma, gravity->sigma);
  const double since_s = secondsOf(m_steps.front().stamp_ns);
  if (off < 0.5 * limit && of(Sensor::accelerometer).may_recover)
    recover(Sensor::accelerometer, since_s);
  if (!(off > limit))
    return;
  const Vector3d up = kGravity * Vector3d::UnitZ() + gravity->off;
  const bool is_length_wrong = std::abs(up.norm() - kGravity) > limit, is_bias = off < kMostBias;
  if (is_bias && remembered_s < kDecided_s)
    return;
  if (is_length_wrong || (is_bias && !isTurnedBy(up)))
    raise(Sensor::accelerometer, "bias", since_s,
          fmt::format("accelerometer: off by {:.1f} m/s^2 since {:.1f} s", off, since_s), Lasts::until_agree);
  else
    raise(Sensor::odometry, "tilt", since_s,
          fmt::format("odometry: its roll and pitch are {:.0f} degrees off gravity",
                      std::atan2(up.head<2>().norm(), up.z()) / kDegree));
}

/// Whether the points show the odometry turned as it is where \p up is upwards in its world.
bool SensorMonitor::isTurnedBy(const Vector3d &up) const
{
  constexpr double kBetter = 9 * kTogether, kMostEach = 6; // twice the log of the likelihood; of one comparison
  const Vector3d turn = m_steps.back().wMb.R.transpose() * Vector3d::UnitZ().cross(up.normalized());
  double gain = 0;
  for (const Comparison &c : m_comparisons) {
    if (c.askew_variance <= 0)
      continue;
    const Vector3d left = c.askew - (turn - c.direction * c.direction.dot(turn));
    gain += std::clamp((c.askew.squaredNorm() - left.squaredNorm()) / c.askew_variance, -kMostEach, kMostEach);
  }
  return gain > kBetter;
}
} // namespace bole
