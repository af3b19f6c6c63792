// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/navdata_odometry.h"

#include "ardrone/bytes.h"

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
} // namespace bole
