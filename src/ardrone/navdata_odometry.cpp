// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/navdata_odometry.h"
#include "ardrone/bytes.h"
#include "geometry/constants.h"
#include "geometry/so3.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

namespace bole
{
namespace
{
constexpr std::uint32_t kHeader = 0x55667788, kHeaderAlso = 0x55667789;
constexpr std::size_t kHeaderSize = 16, kOptionHead = 4;
constexpr std::uint16_t kDemo = 0, kTime = 1, kPhysical = 3, kChecksum = 0xFFFF;
constexpr std::size_t kDemoUsed = 40, kPhysicalUsed = 30;

Eigen::Vector3f readVector(const std::uint8_t *p)
{
  return {readLittleEndian<float>(p), readLittleEndian<float>(p + 4), readLittleEndian<float>(p + 8)};
}

// What no AR.Drone can do: a number beyond is damage or malice, and the option is not used.
constexpr float kLargestAngle_mdeg = 400e3f, kFastest_mm_s = 30e3f, kLargestAcceleration_mg = 20e3f,
                kFastest_deg_s = 4e3f;
constexpr double kHighest_mm = 300e3;

bool isPossible(const Eigen::Vector3f &v, float most) { return v.allFinite() && v.cwiseAbs().maxCoeff() <= most; }

void readTypedOptions(Navdata &navdata)
{
  const auto bytesOf = [&](std::uint16_t id, std::size_t least) -> const std::uint8_t * {
    const auto found = navdata.options.find(id);
    return found != navdata.options.end() && found->second.size() >= least ? found->second.data() : nullptr;
  };
  if (const std::uint8_t *p = bytesOf(kDemo, kDemoUsed)) {
    Navdata::Demo demo;
    demo.control_state = readLittleEndian<std::uint32_t>(p);
    demo.battery_percent = readLittleEndian<std::uint32_t>(p + 4);
    const Eigen::Vector3f theta_phi_psi = readVector(p + 8);
    demo.phi_theta_psi_mdeg = {theta_phi_psi.y(), theta_phi_psi.x(), theta_phi_psi.z()};
    demo.altitude_mm = readLittleEndian<std::int32_t>(p + 20);
    demo.velocity_mm_s = readVector(p + 24);
    if (isPossible(demo.phi_theta_psi_mdeg, kLargestAngle_mdeg) && isPossible(demo.velocity_mm_s, kFastest_mm_s) &&
        std::abs(static_cast<double>(demo.altitude_mm)) <= kHighest_mm)
      navdata.demo = demo;
  }
  if (const std::uint8_t *p = bytesOf(kTime, 4))
    navdata.time = readLittleEndian<std::uint32_t>(p);
  if (const std::uint8_t *p = bytesOf(kPhysical, kPhysicalUsed)) {
    Navdata::Physical physical;
    physical.acceleration_mg = readVector(p + 6);
    physical.rate_deg_s = readVector(p + 18);
    if (isPossible(physical.acceleration_mg, kLargestAcceleration_mg) &&
        isPossible(physical.rate_deg_s, kFastest_deg_s))
      navdata.physical = physical;
  }
}
} // namespace

bool parseNavdata(const std::uint8_t *data, std::size_t size, Navdata &navdata)
{
  navdata = {};
  if (size < kHeaderSize)
    return false;
  const auto header = readLittleEndian<std::uint32_t>(data);
  if (header != kHeader && header != kHeaderAlso)
    return false;
  navdata.state = readLittleEndian<std::uint32_t>(data + 4);
  navdata.sequence = readLittleEndian<std::uint32_t>(data + 8);
  navdata.vision_defined = readLittleEndian<std::uint32_t>(data + 12) != 0;

  for (std::size_t at = kHeaderSize; at + kOptionHead <= size;) {
    const auto id = readLittleEndian<std::uint16_t>(data + at);
    const auto length = readLittleEndian<std::uint16_t>(data + at + 2);
    if (length < kOptionHead || at + length > size)
      return false;
    if (id == kChecksum) {
      if (length != kOptionHead + 4 || at + length != size)
        return false;
      if (readLittleEndian<std::uint32_t>(data + at + kOptionHead) !=
          std::accumulate(data, data + at, std::uint32_t{0}))
        return false;
      readTypedOptions(navdata);
      return true;
    }
    navdata.options[id].assign(data + at + kOptionHead, data + at + length); // at most a datagram
    at += length;
  }
  return false;
}

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
