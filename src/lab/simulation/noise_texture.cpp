// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/renderer_parts.h"

#include "simulation/random.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
/// Periodic value noise with \p cells_u x \p cells_v random values over the texture, added to \p texels.
void addNoise(std::vector<float> &texels, int columns, int rows, int cells_u, int cells_v, float amplitude,
              Random &random)
{
  std::vector<float> grid(static_cast<std::size_t>(cells_u) * cells_v);
  for (float &value : grid)
    value = static_cast<float>(random.normal());
  const auto smooth = [](float t) { return t * t * (3 - 2 * t); };
  for (int row = 0; row < rows; ++row) {
    const float y = static_cast<float>(row) * cells_v / rows;
    const int y0 = static_cast<int>(y), y1 = (y0 + 1) % cells_v;
    const float fy = smooth(y - y0);
    for (int column = 0; column < columns; ++column) {
      const float x = static_cast<float>(column) * cells_u / columns;
      const int x0 = static_cast<int>(x), x1 = (x0 + 1) % cells_u;
      const float fx = smooth(x - x0);
      const float low = grid[y0 * cells_u + x0] * (1 - fx) + grid[y0 * cells_u + x1] * fx;
      const float high = grid[y1 * cells_u + x0] * (1 - fx) + grid[y1 * cells_u + x1] * fx;
      texels[static_cast<std::size_t>(row) * columns + column] += amplitude * (low * (1 - fy) + high * fy);
    }
  }
}

std::vector<float> exponential(std::vector<float> texels)
{
  double sum = 0;
  for (float &value : texels) {
    value = std::exp(std::clamp(value, -2.f, 2.f));
    sum += value;
  }
  for (float &value : texels)
    value *= static_cast<float>(texels.size() / sum);
  return texels;
}
} // namespace

NoiseTexture::NoiseTexture(int columns, int rows, std::vector<float> texels)
{
  m_levels.push_back({columns, rows, std::move(texels)});
  while (columns > 1 && rows > 1) {
    const std::vector<float> &fine = m_levels.back().values;
    const int width = columns / 2, height = rows / 2;
    std::vector<float> coarse(static_cast<std::size_t>(width) * height);
    for (int row = 0; row < height; ++row) {
      for (int column = 0; column < width; ++column) {
        const float *p = &fine[static_cast<std::size_t>(2 * row) * columns + 2 * column];
        coarse[static_cast<std::size_t>(row) * width + column] = 0.25f * (p[0] + p[1] + p[columns] + p[columns + 1]);
      }
    }
    columns = width;
    rows = height;
    m_levels.push_back({columns, rows, std::move(coarse)});
  }
}

NoiseTexture furrowedBark(std::uint64_t seed)
{
  constexpr int kColumns = 256, kRows = 1024;
  Random random(seed, 101);
  std::vector<float> texels(kColumns * kRows, 0.f), ridges(kColumns * kRows, 0.f);
  addNoise(ridges, kColumns, kRows, 32, 40, 1.f, random); // furrows along the trunk
  addNoise(ridges, kColumns, kRows, 64, 120, 0.5f, random);
  for (std::size_t k = 0; k < texels.size(); ++k)
    texels[k] = 0.6f * std::min(1.f, std::abs(ridges[k])) - 0.3f;
  addNoise(texels, kColumns, kRows, 4, 8, 0.14f, random); // moss and stains
  addNoise(texels, kColumns, kRows, 16, 64, 0.12f, random);
  addNoise(texels, kColumns, kRows, 128, 512, 0.16f, random);
  return NoiseTexture(kColumns, kRows, exponential(std::move(texels)));
}

NoiseTexture smoothBark(std::uint64_t seed)
{
  constexpr int kColumns = 256, kRows = 1024;
  Random random(seed, 102);
  std::vector<float> texels(kColumns * kRows, 0.f), marks(kColumns * kRows, 0.f);
  addNoise(marks, kColumns, kRows, 16, 256, 1.f, random); // wide and low: cross marks
  for (std::size_t k = 0; k < texels.size(); ++k)
    texels[k] = marks[k] > 1.3f ? -1.1f : 0.f;
  addNoise(texels, kColumns, kRows, 4, 6, 0.10f, random);
  addNoise(texels, kColumns, kRows, 16, 32, 0.07f, random);
  addNoise(texels, kColumns, kRows, 128, 512, 0.06f, random);
  return NoiseTexture(kColumns, kRows, exponential(std::move(texels)));
}

NoiseTexture groundCover(std::uint64_t seed)
{
  constexpr int kSize = 1024;
  Random random(seed, 103);
  std::vector<float> texels(kSize * kSize, 0.f);
  for (const auto &[cells, amplitude] :
       {std::pair(8, 0.12f), {32, 0.10f}, {128, 0.13f}, {256, 0.18f}, {512, 0.22f}, {1024, 0.24f}})
    addNoise(texels, kSize, kSize, cells, cells, amplitude, random);
  return NoiseTexture(kSize, kSize, exponential(std::move(texels)));
}
} // namespace bole
