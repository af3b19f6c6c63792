// SPDX-License-Identifier: GPL-2.0-or-later
// What is said of a sensor that is left out.
#include "motion/motion_filter.h"

#include "geometry/constants.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
namespace
{
// Share of the last second that a source was left out; pictures of movers err for a moment.
constexpr double kNamed = 0.35, kPointsNamed = 0.6, kOver = 0.15;
constexpr double kSilence_s = 0.5;
constexpr double kJump_m = 0.3;
constexpr int kMostJumps = 3; // that are told one by one

const char *sensorOf(Source source)
{
  constexpr const char *kNames[] = {"gyro", "accelerometer", "odometry", "odometry", "odometry", "odometry", "images"};
  return kNames[static_cast<int>(source)];
}

/// What is told of a source that is left out, and by how much it differs.
std::string textOf(Source source, const Eigen::VectorXd &residual, double since_s)
{
  switch (source) {
  case Source::gyro:
    return fmt::format("gyro: contradicts the other sensors since {:.1f} s (bias, axes, sign, units or clock)",
                       since_s);
  case Source::accelerometer:
    return fmt::format("accelerometer: contradicts the motion since {:.1f} s", since_s);
  case Source::odometry_turn:
    return fmt::format("odometry: its rotation contradicts the other sensors since {:.1f} s", since_s);
  case Source::odometry_step:
    return fmt::format("odometry: its steps contradict the other sensors since {:.1f} s, now by {:.2f} m", since_s,
                       residual.norm());
  case Source::odometry_tilt:
    return fmt::format("odometry: its roll and pitch are {:.0f} degrees off gravity since {:.1f} s",
                       residual.norm() / kDegree, since_s);
  case Source::odometry_height:
    return fmt::format("odometry: its height is off by {:.1f} m since {:.1f} s", residual.norm(), since_s);
  case Source::points:
    return fmt::format("images: contradict the other sensors since {:.1f} s (late, skewed or of another camera)",
                       since_s);
  }
  return {};
}

const char *kindOf(Source source)
{
  constexpr const char *kKinds[] = {"rotation", "force", "rotation", "step", "tilt", "height", "rotation"};
  return kKinds[static_cast<int>(source)];
}
} // namespace

void MotionFilter::raise(Source source, const std::string &kind, double since_s, const std::string &text)
{
  m_verdicts.push_back({sensorOf(source), kind, since_s, text});
}

/// One line for each time that a source is left out for long, and for each of the first jumps.
void MotionFilter::name(const Frame &frame)
{
  nameSilence(frame);
  for (std::size_t s = 0; s < kSources; ++s) {
    const auto source = static_cast<Source>(s);
    const auto rows = std::find_if(m_rows.begin(), m_rows.end(), [&](const Rows &one) { return one.source == source; });
    const Eigen::VectorXd residual = rows != m_rows.end() ? rows->residual : Eigen::VectorXd::Zero(1).eval();
    if (m_is_out[s] && !m_since_ns[s]) {
      m_since_ns[s] = m_is_held ? m_stamp_ns : frame.stamp_ns;
      if (source == Source::odometry_step && residual.norm() > kJump_m && ++m_jumps <= kMostJumps)
        raise(source, "jump", secondsOf(frame.stamp_ns),
              fmt::format("odometry: jump of {:.1f} m at {:.1f} s", residual.norm(), secondsOf(frame.stamp_ns)));
    }
    if (m_out[s] < kOver && !m_is_out[s]) {
      m_since_ns[s].reset();
      m_is_named[s] = false;
    }
    if (!m_is_out[s] || m_out[s] < (source == Source::points ? kPointsNamed : kNamed) || m_is_named[s])
      continue;
    m_is_named[s] = true;
    const double since_s = secondsOf(*m_since_ns[s]);
    if (m_is_held && isOdometry(source)) {
      if (source == Source::odometry_step)
        raise(source, "stuck", since_s, fmt::format("odometry: frozen since {:.1f} s", since_s));
    }
    else if (source == Source::gyro && m_same_rates > 0)
      raise(source, "stuck", since_s, fmt::format("gyro: repeats its value since {:.1f} s", since_s));
    else
      raise(source, kindOf(source), since_s, textOf(source, residual, since_s));
  }
}

/// A sensor that said something and says nothing more.
void MotionFilter::nameSilence(const Frame &frame)
{
  const auto check = [&](Source source, bool is_there, std::optional<std::int64_t> &last_ns, bool &is_silent) {
    if (is_there)
      last_ns = frame.stamp_ns;
    if (!last_ns || is_there) {
      is_silent = false;
      return;
    }
    const double since_s = secondsOf(*last_ns);
    if (!is_silent && secondsOf(frame.stamp_ns) - since_s > kSilence_s) {
      is_silent = true;
      raise(source, "ended", since_s, fmt::format("{}: nothing since {:.1f} s", sensorOf(source), since_s));
    }
  };
  check(Source::gyro, !frame.gyro.empty(), m_last_gyro_ns, m_is_gyro_silent);
  check(Source::odometry_step, frame.wMb_odometry.has_value(), m_last_odometry_ns, m_is_odometry_silent);
}
} // namespace bole
