// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Random numbers that are the same on every machine and with every standard library.

#include <Eigen/Core>

#include <cstdint>

namespace bole
{
/// A small generator (SplitMix64, public domain algorithm of S. Vigna) with the few distributions the simulator needs;
/// the distributions of the standard library differ from one implementation to the next.
///
/// Law: two generators of one seed and stream give the same numbers. Different streams of one seed
/// are independent, so that asking one part of the forest for more numbers changes no other part.
class Random
{
public:
  explicit Random(std::uint64_t seed, std::uint64_t stream = 0);

  std::uint64_t next();
  /// In [0, 1).
  double uniform() { return static_cast<double>(next() >> 11) * 0x1.0p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Mean 0, standard deviation 1 (Box and Muller).
  double normal();
  /// Each axis normal with the standard deviation \p sigma.
  Eigen::Vector3d normal3(double sigma);

private:
  std::uint64_t m_state;
  bool m_has_spare = false;
  double m_spare = 0;
};
} // namespace bole
