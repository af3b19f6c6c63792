// SPDX-License-Identifier: GPL-2.0-or-later
// The encoder is written from the published facts alone, by the definitions (direct cosine sums, a
// walk along the diagonals), so that it can disagree with the decoder.
#include <bole/ardrone/uvlc.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
class BitSink
{
public:
  void put(std::uint32_t value, int count)
  {
    for (int i = count - 1; i >= 0; --i)
      m_bits.push_back(((value >> i) & 1u) != 0);
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
    while (m_bits.size() % 32 != 0)
      m_bits.push_back(false);
  }
  std::vector<std::uint8_t> bytes()
  {
    padToWord();
    std::vector<std::uint8_t> out;
    for (std::size_t word = 0; word < m_bits.size(); word += 32) {
      std::uint32_t value = 0;
      for (std::size_t i = 0; i < 32; ++i)
        value = 2 * value + (m_bits[word + i] ? 1 : 0);
      for (int shift = 0; shift < 32; shift += 8)
        out.push_back(static_cast<std::uint8_t>(value >> shift));
    }
    return out;
  }

private:
  std::vector<bool> m_bits;
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

double cosine(int x, int u)
{
  static const std::vector<double> table = [] {
    std::vector<double> t(64);
    for (int i = 0; i < 64; ++i)
      t[static_cast<std::size_t>(i)] = std::cos((2 * (i / 8) + 1) * (i % 8) * std::acos(-1.0) / 16);
    return t;
  }();
  return table[static_cast<std::size_t>(x * 8 + u)];
}

/// Quantised coefficients of the 8x8 block whose pixel (x, y) is pixel(x, y), in the order of the
/// stream.
template <typename Pixel> std::vector<int> transform(const Pixel &pixel)
{
  static const auto walk = diagonalWalk();
  double columns[8][8] = {}; // over y, for each x
  for (int x = 0; x < 8; ++x)
    for (int v = 0; v < 8; ++v)
      for (int y = 0; y < 8; ++y)
        columns[x][v] += pixel(x, y) * cosine(y, v);
  std::vector<int> levels;
  for (const auto &[v, u] : walk) {
    double sum = 0;
    for (int x = 0; x < 8; ++x)
      sum += columns[x][v] * cosine(x, u);
    const double scale = 0.25 * (u == 0 ? std::sqrt(0.5) : 1) * (v == 0 ? std::sqrt(0.5) : 1);
    const int step = 3 + 2 * (u + v);
    levels.push_back(static_cast<int>(std::lround(sum * scale / step)));
  }
  return levels;
}

bool hasDetail(const std::vector<int> &levels)
{
  return std::any_of(levels.begin() + 1, levels.end(), [](int level) { return level != 0; });
}

void putBlock(BitSink &sink, const std::vector<int> &levels)
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
  throw vpException(
      vpException::dimensionError,
      "image size = %ux%u, must be 160x120 or 88x72 times a power of two for an AR.Drone 1", width,
      height);
}

void putMacroblock(BitSink &sink, const vpImage<unsigned char> &image, int left, int top)
{
  const auto at = [&image](int x, int y) {
    const int row = std::min(y, static_cast<int>(image.getHeight()) - 1);
    const int column = std::min(x, static_cast<int>(image.getWidth()) - 1);
    return static_cast<double>(image[row][column]);
  };
  std::vector<std::vector<int>> blocks;
  for (const auto &[dx, dy] : {std::pair{0, 0}, std::pair{8, 0}, std::pair{0, 8}, std::pair{8, 8}})
    blocks.push_back(
        transform([&, dx = dx, dy = dy](int x, int y) { return at(left + dx + x, top + dy + y); }));
  for (int colour = 0; colour < 2; ++colour)
    blocks.push_back(transform([](int, int) { return 128.0; }));
  std::uint32_t description = 1u << 7;
  for (std::size_t block = 0; block < blocks.size(); ++block)
    description |= (hasDetail(blocks[block]) ? 1u : 0u) << block;
  sink.put(0, 1);
  sink.put(description, 8);
  for (const auto &levels : blocks)
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
