// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Tabulated noise for bark and ground, in a pyramid so that far surfaces do not alias.

#include <cstdint>
#include <vector>

namespace bole
{
/// A periodic grey texture with its halved copies.
class NoiseTexture
{
public:
  /// \param columns, rows powers of two.
  NoiseTexture(int columns, int rows, std::vector<float> texels);

  /// Value at (u, v) in texels of the finest level, wrapped, nearest texel of the level whose
  /// texels are about \p footprint fine texels large.
  float at(float u, float v, float footprint) const
  {
    int level = 0;
    while (footprint > 1.5f && level + 1 < static_cast<int>(m_levels.size())) {
      footprint *= 0.5f;
      u *= 0.5f;
      v *= 0.5f;
      ++level;
    }
    const Level &texels = m_levels[level];
    const int column = static_cast<int>(u + 65536.f) & (texels.columns - 1);
    const int row = static_cast<int>(v + 65536.f) & (texels.rows - 1);
    return texels.values[row * texels.columns + column];
  }

private:
  struct Level
  {
    int columns, rows;
    std::vector<float> values;
  };
  std::vector<Level> m_levels;
};

/// Furrowed bark: 256 texels round the trunk, 1024 along it; mean 1.
NoiseTexture furrowedBark(std::uint64_t seed);
/// Smooth bright bark with dark cross marks, as of birch and aspen; mean near 1.
NoiseTexture smoothBark(std::uint64_t seed);
/// Grass, leaves and soil, 1024x1024 texels; mean 1.
NoiseTexture groundCover(std::uint64_t seed);
} // namespace bole
