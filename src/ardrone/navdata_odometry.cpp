// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/navdata_odometry.h"
#include "geometry/constants.h"
#include "geometry/require_range.h"
#include "geometry/so3.h"
#include "geometry/yaw.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr double kCorrelation_s = 0.1;   // of the velocity's error
constexpr double kMostPackets_Hz = 1000; // by the drone's clock, which sends 200: a flood fills no memory

Eigen::Matrix3d turnedBy(double yaw) { return Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix(); }

/// What one packet says by itself: attitude, velocity, rate, height.
BodyState readState(std::int64_t stamp_ns, const Navdata &navdata)
{
  BodyState state;
  state.stamp_ns = stamp_ns;
  state.state = navdata.state;
  state.flight_phase = navdata.flightPhase();
  state.battery = navdata.demo->battery_percent / 100.0;
  state.height = std::max(0, navdata.demo->altitude_mm) * 1e-3;
  const Eigen::Vector3d angles = navdata.demo->phi_theta_psi_mdeg.cast<double>() * 1e-3 * kDegree;
  state.wMb.R = attitudeFromDrone(angles.x(), angles.y(), angles.z());
  state.velocity = flipDroneAxes(navdata.demo->velocity_mm_s.cast<double>() * 1e-3);
  if (navdata.physical) {
    state.rate = flipDroneAxes(navdata.physical->rate_deg_s.cast<double>() * kDegree);
    state.force = flipDroneAxes(navdata.physical->acceleration_mg.cast<double>() * 1e-3 * kGravity);
  }
  return state;
}

BodyState interpolated(const BodyState &a, const BodyState &b, std::int64_t stamp_ns)
{
  const double share = static_cast<double>(stamp_ns - a.stamp_ns) / static_cast<double>(b.stamp_ns - a.stamp_ns);
  BodyState out = share < 0.5 ? a : b;
  out.stamp_ns = stamp_ns;
  out.wMb.t = a.wMb.t + share * (b.wMb.t - a.wMb.t);
  out.wMb.R = a.wMb.R * expSo3(share * logSo3(orthonormalized(a.wMb.R.transpose() * b.wMb.R)));
  out.velocity = a.velocity + share * (b.velocity - a.velocity);
  out.height = a.height + share * (b.height - a.height);
  if (a.rate && b.rate)
    out.rate = *a.rate + share * (*b.rate - *a.rate);
  return out;
}
} // namespace

void NavdataOdometry::Options::validate() const
{
  requireRange("velocity_sigma", velocity_sigma, 1e-9, 5);
  requireRange("scale_sigma", scale_sigma, 1e-9, 1);
  requireRange("height_sigma", height_sigma, 1e-9, 1);
  requireRange("tilt_sigma", tilt_sigma, 1e-9, 0.5);
  requireRange("yaw_sigma", yaw_sigma, 1e-9, 0.5);
  requireRange("ground_step", ground_step, 0.02, 5);
  requireRange("largest_gap_s", largest_gap_s, 0.05, 10);
  requireRange("extrapolation_s", extrapolation_s, 1e-9, 1);
  requireRange("history_s", history_s, 1, 600);
}

Eigen::Matrix3d attitudeFromDrone(double roll, double pitch, double yaw)
{
  return (Eigen::AngleAxisd(-yaw, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(-pitch, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

Eigen::Vector3d attitudeToDrone(const Eigen::Matrix3d &wRb)
{
  const double roll = std::atan2(wRb(2, 1), wRb(2, 2));
  const double pitch_up = std::asin(std::clamp(wRb(2, 0), -1.0, 1.0));
  return {roll, pitch_up, -yawOf(wRb)};
}

NavdataOdometry::NavdataOdometry() : NavdataOdometry(Options{}) {}
NavdataOdometry::NavdataOdometry(const Options &options) : m_options(options) { m_options.validate(); }

void NavdataOdometry::restart()
{
  if (!m_history.empty())
    m_before_restart = m_history.back();
  m_history.clear();
}

void NavdataOdometry::add(std::int64_t stamp_ns, const Navdata &navdata)
{
  if (!navdata.demo || (!m_history.empty() && stamp_ns <= m_history.back().stamp_ns))
    return;
  BodyState state = readState(stamp_ns, navdata);
  if (m_before_restart && m_history.empty())
    m_yaw_offset = yawOf(m_before_restart->wMb.R) - yawOf(state.wMb.R);
  state.wMb.R = turnedBy(m_yaw_offset) * state.wMb.R;

  const BodyState *before = m_history.empty() ? (m_before_restart ? &*m_before_restart : nullptr) : &m_history.back();
  if (before == nullptr) {
    state.wMb.t = {0, 0, state.height};
  }
  else {
    const double elapsed = m_history.empty() ? 0 : static_cast<double>(stamp_ns - before->stamp_ns) * 1e-9;
    const bool bridged = elapsed <= m_options.largest_gap_s;
    const Eigen::Vector3d mean_velocity = 0.5 * (before->wMb.R * before->velocity + state.wMb.R * state.velocity);
    state.wMb.t = before->wMb.t + (bridged ? elapsed : 0.0) * mean_velocity;
    if (state.height > 0) {
      const double jump = m_ground + state.height - state.wMb.t.z();
      // The filter behind the height converges slowly: small differences belong to z, large ones to the ground.
      if (std::abs(jump) > m_options.ground_step)
        m_ground -= jump;
      else
        state.wMb.t.z() += jump;
    }
  }
  m_history.push_back(state);
  const auto oldest = stamp_ns - static_cast<std::int64_t>(m_options.history_s * 1e9);
  const auto most = static_cast<std::size_t>(m_options.history_s * kMostPackets_Hz);
  while (m_history.size() > 2 && (m_history.front().stamp_ns < oldest || m_history.size() > most))
    m_history.pop_front();
}

std::optional<BodyState> NavdataOdometry::newest() const
{
  return m_history.empty() ? std::nullopt : std::optional<BodyState>(m_history.back());
}

std::optional<BodyState> NavdataOdometry::at(std::int64_t stamp_ns) const
{
  if (m_history.empty() || stamp_ns < m_history.front().stamp_ns)
    return std::nullopt;
  const auto after =
      std::lower_bound(m_history.begin(), m_history.end(), stamp_ns,
                       [](const BodyState &state, std::int64_t stamp) { return state.stamp_ns < stamp; });
  if (after == m_history.end()) {
    BodyState last = m_history.back();
    const double ahead = static_cast<double>(stamp_ns - last.stamp_ns) * 1e-9;
    if (ahead > m_options.extrapolation_s)
      return std::nullopt;
    last.stamp_ns = stamp_ns;
    last.wMb.t += ahead * (last.wMb.R * last.velocity);
    if (last.rate)
      last.wMb.R = last.wMb.R * expSo3(ahead * *last.rate);
    return last;
  }
  if (after == m_history.begin())
    return *after;
  const BodyState &before = *(after - 1);
  if (static_cast<double>(after->stamp_ns - before.stamp_ns) * 1e-9 > m_options.largest_gap_s)
    return std::nullopt;
  return interpolated(before, *after, stamp_ns);
}

std::vector<GyroSample> NavdataOdometry::gyro(std::int64_t from_ns, std::int64_t to_ns) const
{
  std::vector<GyroSample> samples;
  for (const BodyState &state : m_history)
    if (state.rate && state.stamp_ns > from_ns && state.stamp_ns <= to_ns)
      samples.push_back({state.stamp_ns, *state.rate, state.force});
  return samples;
}

Matrix6d NavdataOdometry::stepCovariance(std::int64_t from_ns, std::int64_t to_ns) const
{
  const double elapsed = std::max(1e-3, static_cast<double>(to_ns - from_ns) * 1e-9);
  const auto end = at(to_ns);
  const double speed = end ? end->velocity.norm() : 0;
  const double horizontal = m_options.velocity_sigma * m_options.velocity_sigma * elapsed * kCorrelation_s +
                            std::pow(m_options.scale_sigma * speed * elapsed, 2);
  Eigen::Matrix3d position =
      Eigen::Vector3d(horizontal, horizontal, 2 * std::pow(m_options.height_sigma, 2)).asDiagonal();
  Eigen::Matrix3d rotation = Eigen::Vector3d(std::pow(m_options.tilt_sigma, 2), std::pow(m_options.tilt_sigma, 2),
                                             std::pow(m_options.yaw_sigma, 2) * elapsed)
                                 .asDiagonal();
  if (end) { // world axes (up to the yaw) to the body's
    const Eigen::Matrix3d bRw = end->wMb.R.transpose();
    position = bRw * position * bRw.transpose();
    rotation = bRw * rotation * bRw.transpose();
  }
  Matrix6d covariance = Matrix6d::Zero();
  covariance.topLeftCorner<3, 3>() = position;
  covariance.bottomRightCorner<3, 3>() = rotation;
  return covariance;
}
} // namespace bole
