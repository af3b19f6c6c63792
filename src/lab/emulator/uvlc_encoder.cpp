// SPDX-License-Identifier: GPL-2.0-or-later
// The encoder is written from the published facts alone, by the definitions (direct cosine sums, a
// walk along the diagonals), so that it can disagree with the decoder.
#include "emulator/wire_format.h"

#include "support/text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <utility>

namespace bole
{
namespace
{
class BitSink
{
public:
  void put(std::uint32_t value, int count)
  {
    for (int i = count - 1; i >= 0; --i) {
      m_word = 2 * m_word + ((value >> i) & 1u);
      if (++m_used == 32)
        flush();
    }
  }
  /// A magnitude of at least 1 as the guide's tables print it: as many zeros as it has binary
  /// digits, then its binary digits (the first of which is the one).
  void putCoarse(std::uint32_t magnitude)
  {
    int digits = 0;
    while ((magnitude >> digits) != 0)
      ++digits;
    put(0, digits);
    put(1, 1);
    put(magnitude & ((1u << (digits - 1)) - 1), digits - 1);
  }
  void padToWord()
  {
    if (m_used > 0)
      put(0, 32 - m_used);
  }
  std::vector<std::uint8_t> bytes()
  {
    padToWord();
    return std::move(m_bytes);
  }

private:
  void flush()
  {
    for (int shift = 0; shift < 32; shift += 8)
      m_bytes.push_back(static_cast<std::uint8_t>(m_word >> shift));
    m_word = 0;
    m_used = 0;
  }

  std::vector<std::uint8_t> m_bytes;
  std::uint32_t m_word = 0;
  int m_used = 0;
};

/// (row, column) along the anti-diagonals, turning at the edges.
std::vector<std::pair<int, int>> diagonalWalk()
{
  std::vector<std::pair<int, int>> walk;
  for (int sum = 0; sum < 15; ++sum)
    for (int i = 0; i <= sum; ++i) {
      const int row = sum % 2 == 0 ? sum - i : i;
      if (row < 8 && sum - row < 8)
        walk.emplace_back(row, sum - row);
    }
  return walk;
}

/// cosine[x][u] = cos((2x + 1) u pi / 16), for a block a product a coefficient and pixel.
using Cosines = std::array<std::array<double, 8>, 8>;
const Cosines kCosine = [] {
  Cosines table{};
  for (int x = 0; x < 8; ++x)
    for (int u = 0; u < 8; ++u)
      table[x][u] = std::cos((2 * x + 1) * u * std::acos(-1.0) / 16);
  return table;
}();
const std::vector<std::pair<int, int>> kWalk = diagonalWalk();

using Block = std::array<double, 64>; // pixels, row by row
using Levels = std::array<int, 64>;   // quantised, in the order of the stream

Levels transform(const Block &pixels)
{
  std::array<double, 64> columns{}; // [v][x]: the sum over y
  for (int v = 0; v < 8; ++v)
    for (int y = 0; y < 8; ++y)
      for (int x = 0; x < 8; ++x)
        columns[v * 8 + x] += pixels[y * 8 + x] * kCosine[y][v];
  Levels levels{};
  std::size_t position = 0;
  for (const auto &[v, u] : kWalk) {
    double sum = 0;
    for (int x = 0; x < 8; ++x)
      sum += columns[v * 8 + x] * kCosine[x][u];
    const double scale = 0.25 * (u == 0 ? std::sqrt(0.5) : 1) * (v == 0 ? std::sqrt(0.5) : 1);
    levels[position++] = static_cast<int>(std::lround(sum * scale / (3 + 2 * (u + v))));
  }
  return levels;
}

bool hasDetail(const Levels &levels)
{
  return std::any_of(levels.begin() + 1, levels.end(), [](int level) { return level != 0; });
}

void putBlock(BitSink &sink, const Levels &levels)
{
  sink.put(static_cast<std::uint32_t>(levels[0]), 10);
  if (!hasDetail(levels))
    return;
  std::uint32_t run = 0;
  for (std::size_t i = 1; i < levels.size(); ++i) {
    if (levels[i] == 0) {
      ++run;
      continue;
    }
    if (run == 0)
      sink.put(1, 1);
    else
      sink.putCoarse(run);
    const auto magnitude = static_cast<std::uint32_t>(std::min(std::abs(levels[i]), 127));
    if (magnitude == 1)
      sink.put(1, 1);
    else
      sink.putCoarse(magnitude);
    sink.put(levels[i] < 0 ? 1 : 0, 1);
    run = 0;
  }
  sink.put(1, 1); // a run of none
  sink.put(1, 2); // and the end
}

struct Size
{
  std::uint32_t format, resolution;
};

Size sizeCode(unsigned width, unsigned height)
{
  for (std::uint32_t resolution = 1; resolution <= 5; ++resolution) {
    if (width == 160u << (resolution - 1) && height == 120u << (resolution - 1))
      return {2, resolution};
    if (width == 88u << (resolution - 1) && height == 72u << (resolution - 1))
      return {1, resolution};
  }
  throw badValue("image size = {}x{}, must be 160x120 or 88x72 times a power of two for an AR.Drone 1", width, height);
}

Block pixelsAt(const vpImage<unsigned char> &image, int left, int top)
{
  Block pixels{};
  for (int y = 0; y < 8; ++y) {
    const unsigned char *row = image[std::min(top + y, static_cast<int>(image.getHeight()) - 1)];
    for (int x = 0; x < 8; ++x)
      pixels[y * 8 + x] = row[std::min(left + x, static_cast<int>(image.getWidth()) - 1)];
  }
  return pixels;
}

void putMacroblock(BitSink &sink, const vpImage<unsigned char> &image, int left, int top)
{
  static const Levels neutral = [] {
    Block grey;
    grey.fill(128);
    return transform(grey);
  }();
  const std::array<Levels, 6> blocks = {transform(pixelsAt(image, left, top)),
                                        transform(pixelsAt(image, left + 8, top)),
                                        transform(pixelsAt(image, left, top + 8)),
                                        transform(pixelsAt(image, left + 8, top + 8)),
                                        neutral,
                                        neutral};
  std::uint32_t description = 1u << 7;
  for (std::size_t block = 0; block < blocks.size(); ++block)
    description |= (hasDetail(blocks[block]) ? 1u : 0u) << block;
  sink.put(0, 1);
  sink.put(description, 8);
  for (const Levels &levels : blocks)
    putBlock(sink, levels);
}
} // namespace

std::vector<std::uint8_t> encodeUvlc(const vpImage<unsigned char> &image, std::uint32_t number)
{
  const auto [format, resolution] = sizeCode(image.getWidth(), image.getHeight());
  const int groups = (static_cast<int>(image.getHeight()) + 15) / 16;
  const int columns = (static_cast<int>(image.getWidth()) + 15) / 16;
  BitSink sink;
  for (int group = 0; group < groups; ++group) {
    sink.padToWord();
    sink.put(0x20u | static_cast<std::uint32_t>(group), 22);
    if (group == 0) {
      sink.put(format, 2);
      sink.put(resolution, 3);
      sink.put(0, 3); // intra
    }
    sink.put(31, 5);
    if (group == 0)
      sink.put(number, 32);
    for (int column = 0; column < columns; ++column)
      putMacroblock(sink, image, column * 16, group * 16);
  }
  sink.padToWord();
  sink.put(0x3f, 22);
  return sink.bytes();
}
} // namespace bole
