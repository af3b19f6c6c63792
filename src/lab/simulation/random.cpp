// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/random.h"

#include <cmath>

namespace bole
{
namespace
{
constexpr std::uint64_t kGamma = 0x9e3779b97f4a7c15ULL;

std::uint64_t mixed(std::uint64_t z)
{
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}
} // namespace

Random::Random(std::uint64_t seed, std::uint64_t stream) : m_state(mixed(seed + kGamma) ^ mixed(mixed(stream) + kGamma))
{
}

std::uint64_t Random::next()
{
  m_state += kGamma;
  return mixed(m_state);
}

double Random::normal()
{
  if (m_has_spare) {
    m_has_spare = false;
    return m_spare;
  }
  const double radius = std::sqrt(-2 * std::log(1 - uniform()));
  const double angle = 2 * M_PI * uniform();
  m_spare = radius * std::sin(angle);
  m_has_spare = true;
  return radius * std::cos(angle);
}

Eigen::Vector3d Random::normal3(double sigma)
{
  const double x = normal(), y = normal(), z = normal();
  return sigma * Eigen::Vector3d(x, y, z);
}
} // namespace bole
