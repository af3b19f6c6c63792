// SPDX-License-Identifier: GPL-2.0-or-later
// Any datagram as navdata, with its checksum put right so that the options are reached; what is
// read must be read again from its own encoding, and the odometry must stay finite.
#include "ardrone/drone_clock.h"
#include "ardrone/navdata_odometry.h"
#include "emulator/wire_format.h"

#include <cstdlib>
#include <numeric>
#include <vector>

namespace
{
void use(const std::vector<std::uint8_t> &bytes)
{
  bole::Navdata navdata, again;
  if (!bole::parseNavdata(bytes.data(), bytes.size(), navdata))
    return;
  const auto encoded = bole::encodeNavdata(navdata);
  if (!bole::parseNavdata(encoded.data(), encoded.size(), again) || again.time != navdata.time)
    std::abort();
  static bole::NavdataOdometry odometry;
  static bole::ClockUnwrapper clock(bole::kNavdataTimePeriod_us);
  if (!navdata.demo || navdata.demo->velocity_mm_s.norm() > 1e5f || navdata.demo->phi_theta_psi_mdeg.norm() > 1e9f)
    return;
  odometry.add(clock.unwrap(bole::navdataTimeMicroseconds(navdata.time.value_or(0))) * 1000, navdata);
  if (const auto newest = odometry.newest(); newest && !newest->wMb.isFinite())
    std::abort();
}
} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size)
{
  std::vector<std::uint8_t> bytes(data, data + size);
  use(bytes);
  const std::uint32_t sum = std::accumulate(bytes.begin(), bytes.end(), std::uint32_t{0});
  for (const std::uint32_t part : {0x0008ffffu, sum})
    for (int shift = 0; shift < 32; shift += 8)
      bytes.push_back(static_cast<std::uint8_t>(part >> shift));
  use(bytes);
  return 0;
}
