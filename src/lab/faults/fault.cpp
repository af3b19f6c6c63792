// SPDX-License-Identifier: GPL-2.0-or-later
#include "faults/fault.h"

#include "support/text.h"

#include <algorithm>

namespace bole
{
namespace
{
vpImage<unsigned char> halved(const vpImage<unsigned char> &image)
{
  vpImage<unsigned char> small(image.getHeight() / 2, image.getWidth() / 2);
  for (unsigned v = 0; v < small.getHeight(); ++v)
    for (unsigned u = 0; u < small.getWidth(); ++u)
      small[v][u] = image[2 * v][2 * u];
  return small;
}

void spoilSensors(Frame &frame, FaultKind kind, const std::optional<Pose> &last_odometry)
{
  if (kind == FaultKind::odometry_freeze)
    frame.wMb_odometry = last_odometry;
  if (kind == FaultKind::odometry_jump && frame.wMb_odometry)
    frame.wMb_odometry->t.y() += 1;
  if (kind == FaultKind::odometry_gone)
    frame.wMb_odometry.reset();
  if (kind == FaultKind::gyro_gone)
    frame.gyro.clear();
  if (kind == FaultKind::gyro_bias)
    for (GyroSample &sample : frame.gyro)
      sample.rate.z() += 0.2;
}
} // namespace

const char *toString(FaultKind kind)
{
  return nameOf(kind, {"none", "black", "noise", "smear", "freeze", "wrong size", "odometry-freeze", "odometry-jump",
                       "odometry-gone", "gyro-gone", "gyro-bias"});
}

void spoil(vpImage<unsigned char> &image, FaultKind kind, const vpImage<unsigned char> &last_good, unsigned seed)
{
  const unsigned w = image.getWidth(), h = image.getHeight();
  std::mt19937 random(seed);
  if (kind == FaultKind::black)
    image = static_cast<unsigned char>(0);
  if (kind == FaultKind::noise)
    for (unsigned i = 0; i < image.getSize(); ++i)
      image.bitmap[i] = static_cast<unsigned char>(random() & 255u);
  if (kind == FaultKind::smear)
    for (unsigned v = h / 2; v < h; ++v)
      std::copy(image[h / 2 - 1], image[h / 2 - 1] + w, image[v]);
  if (kind == FaultKind::freeze)
    image = last_good;
  if (kind == FaultKind::wrong_size)
    image = halved(image);
}

void FaultOptions::validate() const
{
  requireRange("fault start_s", start_s, 0, 3600);
  requireRange("fault duration_s", duration_s, 0.05, 3600);
}

FaultInjector::FaultInjector(const FaultOptions &options, unsigned seed) : m_options(options), m_random(seed)
{
  options.validate();
}

bool FaultInjector::apply(Frame &frame, double servoing_s)
{
  const bool is_now = m_options.kind != FaultKind::none && servoing_s >= m_options.start_s &&
                      servoing_s < m_options.start_s + m_options.duration_s;
  if (!is_now) {
    m_last = frame.image;
    m_last_odometry = frame.wMb_odometry;
    return false;
  }
  spoil(frame.image, m_options.kind, m_last, static_cast<unsigned>(m_random()));
  spoilSensors(frame, m_options.kind, m_last_odometry);
  return true;
}
} // namespace bole
