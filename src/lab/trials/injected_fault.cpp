// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/trials/injected_fault.h"

#include "geometry/names.h"
#include "geometry/require_range.h"

namespace bole
{
const char *toString(SensorFault fault)
{
  return nameOf(fault, {"none", "odometry-freeze", "odometry-jump", "odometry-gone", "gyro-gone", "gyro-bias"});
}

FaultOptions faultFromString(const std::string &word)
{
  FaultOptions options;
  options.sensor = valueNamed(word, SensorFault::gyro_bias).value_or(SensorFault::none);
  if (options.sensor == SensorFault::none)
    options.kind = faultKindFromString(word);
  return options;
}

void FaultOptions::validate() const
{
  requireRange("fault start_s", start_s, 0, 3600);
  requireRange("fault duration_s", duration_s, 0.05, 3600);
}

FaultInjector::FaultInjector(const FaultOptions &options, std::uint64_t seed) : m_options(options), m_random(seed, 601)
{
  options.validate();
}

bool FaultInjector::apply(Frame &frame, double servoing_s)
{
  const bool is_any = m_options.kind != FaultKind::none || m_options.sensor != SensorFault::none;
  const bool is_now =
      is_any && servoing_s >= m_options.start_s && servoing_s < m_options.start_s + m_options.duration_s;
  if (!is_now) {
    m_last = frame.image;
    m_last_odometry = frame.wMb_odometry;
    return false;
  }
  if (m_options.kind != FaultKind::none)
    spoil(frame.image, m_options.kind, m_last, unsigned(m_random.next() >> 32));
  spoilSensor(frame);
  return true;
}

void FaultInjector::spoilSensor(Frame &frame) const
{
  switch (m_options.sensor) {
  case SensorFault::none:
    break;
  case SensorFault::odometry_freeze:
    frame.wMb_odometry = m_last_odometry;
    break;
  case SensorFault::odometry_jump:
    if (frame.wMb_odometry)
      frame.wMb_odometry->t.y() += 1;
    break;
  case SensorFault::odometry_gone:
    frame.wMb_odometry.reset();
    break;
  case SensorFault::gyro_gone:
    frame.gyro.clear();
    break;
  case SensorFault::gyro_bias:
    for (GyroSample &sample : frame.gyro)
      sample.rate.z() += 0.2;
    break;
  }
}
} // namespace bole
