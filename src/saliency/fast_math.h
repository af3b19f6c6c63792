// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: logarithm and exponential to about 1e-3, which a compiler can run four at a time.

#include <cstdint>
#include <cstring>

namespace bole
{
/// Natural logarithm of a positive, normal float, absolute error below 1e-3.
inline float fastLog(float x)
{
  std::int32_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  const float exponent = static_cast<float>((bits >> 23) - 127);
  bits = (bits & 0x007fffff) | 0x3f800000;
  float m; // mantissa, [1, 2)
  std::memcpy(&m, &bits, sizeof m);
  const float log2_m = -2.1536207f + m * (3.0478842f + m * (-1.0518750f + m * 0.1582484f));
  return 0.69314718f * (exponent + log2_m);
}

/// exp(x) for -80 <= x <= 80 (clamped), relative error below 1e-3.
inline float fastExp(float x)
{
  x = x < -80.f ? -80.f : (x > 80.f ? 80.f : x);
  const float y = x * 1.44269504f + 127.f;
  const std::int32_t whole = static_cast<std::int32_t>(y); // y > 0
  const float f = y - static_cast<float>(whole);
  const std::int32_t bits = whole << 23;
  float power;
  std::memcpy(&power, &bits, sizeof power);
  return power * (0.99992807f + f * (0.69326098f + f * (0.22606716f + f * 0.08074396f)));
}
} // namespace bole
