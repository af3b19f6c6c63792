// SPDX-License-Identifier: GPL-2.0-or-later
// What the odometry says, against itself and against gravity and the direction of flight.
#include "motion/sensor_monitor.h"

#include "geometry/constants.h"
#include "geometry/median.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
using Eigen::Vector3d;

/// Checks the steps of the odometry from frame to frame.
void SensorMonitor::checkSteps(const Frame &frame, const std::vector<RelativeMotion> &motions)
{
  const double time_s = secondsOf(frame.stamp_ns);
  bool &is_wrong = m_wrong_now[static_cast<int>(Sensor::odometry)];
  if (!frame.wMb_odometry) {
    if (m_had_odometry && secondsOf(frame.stamp_ns - m_last_odometry_ns) > m_options.silence_s)
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
    step.velocity = (step.wMb.t - before.wMb.t) / dt;
    step.is_held = step.parallax_px > 1 && step.wMb.t == before.wMb.t && step.wMb.R == before.wMb.R;
    is_wrong |= step.is_held || before.is_held; // the step after a pause makes up for it
    if (before.velocity) {
      const Eigen::Vector2d change = ((*step.velocity - *before.velocity) * dt).head<2>();
      step.acceleration = change / (dt * dt);
      if (before.acceleration) {
        constexpr double kJerk = 20; // that a small drone reaches for long [m/s^3]
        const double expected = 6 * std::pow(m_options.odometry_walk, 2) * dt + std::pow(kJerk * dt * dt * dt, 2);
        step.scatter = 0.5 * (change - dt * dt * *before.acceleration).squaredNorm() / expected;
      }
      const double extent = change.norm();
      if (extent > m_options.jump + 10 * dt * dt) {
        is_wrong = true;
        step.velocity.reset(); // neither side of a jump tells it: the next step is not judged, the one after it is
        step.acceleration.reset();
        step.scatter = 0;
        step.is_jump = true;
        raiseJump(extent, time_s);
      }
    }
  }
  m_steps.push_back(step);
  checkStandingStill(time_s);
  checkScatter();
}

/// Checks the height at which the flight begins: trunks are looked for above the ground, z = 0.
void SensorMonitor::checkHeight(double height, double time_s)
{
  if (height < m_options.height_low || height > m_options.height_high)
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
  if (scatters.size() >= kLeast && medianOf(scatters) > std::pow(m_options.noise_factor, 2))
    raise(Sensor::odometry, "noise", secondsOf((step - 1)->stamp_ns),
          "odometry: its positions scatter from frame to frame");
}

/// Checks for a constant rotation between the direction of flight by the odometry and by the points.
void SensorMonitor::checkDirection()
{
  constexpr std::size_t kLeast = 24; // comparisons
  constexpr double kTogether = 3;    // that overlap
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
  if (askew.norm() > std::max(m_options.direction_limit, 5 * sigma))
    raise(Sensor::odometry, "direction", secondsOf(m_comparisons.front().a_ns),
          fmt::format("odometry: stands {:.0f} degrees askew to the camera", askew.norm() / kDegree));
}

/// Gravity of the odometry's roll and pitch against the accelerometer's: the mean force between two moments, less the
/// change of the odometry's own velocity from one to the other.
void SensorMonitor::checkTilt(const Frame &frame)
{
  constexpr double kLeast_s = 1.8, kVelocity_s = 0.6; // of the memory, and that a velocity is taken over
  const auto isOdd = [](const Step &step) { return step.is_held || step.is_jump; };
  if (m_steps.empty() || secondsOf(m_steps.back().stamp_ns - m_steps.front().stamp_ns) < kLeast_s ||
      !frame.wMb_odometry || m_samples.empty() ||
      secondsOf(m_steps.back().stamp_ns - m_samples.back().stamp_ns) > kMostGap_s ||
      secondsOf(m_samples.front().stamp_ns - m_steps.front().stamp_ns) > kMostGap_s ||
      std::any_of(m_steps.begin(), m_steps.end(), isOdd))
    return; // force and velocity would be of different times
  struct Velocity
  {
    std::int64_t at_ns;
    Vector3d mean;
  };
  const auto between = [](const Step &a, const Step &b) {
    return Velocity{(a.stamp_ns + b.stamp_ns) / 2, (b.wMb.t - a.wMb.t) / secondsOf(b.stamp_ns - a.stamp_ns)};
  };
  const auto isAfter = [](double time_s) {
    return [time_s](const Step &step) { return secondsOf(step.stamp_ns) > time_s - 1e-3; };
  };
  const Step &first = m_steps.front(), &last = m_steps.back();
  const auto first_end =
      std::find_if(m_steps.begin() + 1, m_steps.end(), isAfter(secondsOf(first.stamp_ns) + kVelocity_s));
  const auto last_begin =
      std::find_if(m_steps.begin(), m_steps.end() - 1, isAfter(secondsOf(last.stamp_ns) - kVelocity_s));
  const Velocity begin = between(first, *first_end), end = between(*last_begin, last);
  Vector3d sum = Vector3d::Zero();
  int count = 0;
  bool varies = false;
  auto step = m_steps.begin();
  const Vector3d *first_force = nullptr;
  std::int64_t before_ns = m_samples.front().stamp_ns;
  for (const GyroSample &sample : m_samples) {
    if (secondsOf(sample.stamp_ns - before_ns) > kMostGap_s)
      return;
    before_ns = sample.stamp_ns;
    while (step + 1 != m_steps.end() && (step->stamp_ns + (step + 1)->stamp_ns) / 2 < sample.stamp_ns)
      ++step; // the one nearest in time
    if (!sample.force || sample.stamp_ns <= begin.at_ns || sample.stamp_ns > end.at_ns)
      continue;
    first_force = first_force == nullptr ? &*sample.force : first_force;
    varies = varies || *first_force != *sample.force;
    sum += step->wMb.R * *sample.force;
    ++count;
  }
  if (count < 40 || !varies)
    return;
  const double dt = secondsOf(end.at_ns - begin.at_ns);
  const Vector3d mean = sum / count - (end.mean - begin.mean) / dt;
  const double tilt = std::atan2(mean.head<2>().norm(), mean.z());
  constexpr double kLongest = 0.2; // beyond it the limit does not grow
  const double allowed = m_options.tilt_limit + std::min(kLongest, 0.2 / (kGravity * dt));
  if (tilt > allowed)
    raise(Sensor::odometry, "tilt", secondsOf(m_steps.front().stamp_ns),
          fmt::format("odometry: its roll and pitch are {:.0f} degrees off gravity", tilt / kDegree));
}
} // namespace bole
