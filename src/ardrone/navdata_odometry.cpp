// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/navdata_odometry.h"
#include "geometry/constants.h"
#include "geometry/so3.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr double kGroundStep = 0.15;     // a faster change of the height is a step in the ground [m]
constexpr double kLargestGap_s = 0.5;    // beyond it the velocity is not trusted to bridge
constexpr double kExtrapolation_s = 0.1; // how far beyond the newest sample at() goes
constexpr double kHistory_s = 10;
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

Eigen::Matrix3d attitudeFromDrone(double roll, double pitch, double yaw)
{
  return (Eigen::AngleAxisd(-yaw, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(-pitch, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

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
    const bool bridged = elapsed <= kLargestGap_s;
    const Eigen::Vector3d mean_velocity = 0.5 * (before->wMb.R * before->velocity + state.wMb.R * state.velocity);
    state.wMb.t = before->wMb.t + (bridged ? elapsed : 0.0) * mean_velocity;
    if (state.height > 0) {
      const double jump = m_ground + state.height - state.wMb.t.z();
      // The filter behind the height converges slowly: small differences belong to z, large ones to the ground.
      if (std::abs(jump) > kGroundStep)
        m_ground -= jump;
      else
        state.wMb.t.z() += jump;
    }
  }
  m_history.push_back(state);
  const auto oldest = stamp_ns - static_cast<std::int64_t>(kHistory_s * 1e9);
  const auto most = static_cast<std::size_t>(kHistory_s * kMostPackets_Hz);
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
    if (ahead > kExtrapolation_s)
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
  if (static_cast<double>(after->stamp_ns - before.stamp_ns) * 1e-9 > kLargestGap_s)
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
} // namespace bole
