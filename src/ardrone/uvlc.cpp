// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/uvlc.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <optional>

namespace bole
{
namespace
{
constexpr const char *kOnlyUvlc = "; only UVLC is decoded, not P264 (set the drone's video:video_codec to 32, not 64)";
constexpr int kTableQuantiser = 31;
constexpr std::uint32_t kEndOfSequence = 31;
constexpr int kLargestResolution = 5;

// Row and column of each coefficient in the order of the stream (JPEG's zigzag).
constexpr std::array<std::uint8_t, 64> kZigzag = {0,  1,  8,  16, 9,  2,  3,  10, 17, 24, 32, 25, 18, 11, 4,  5,
                                                  12, 19, 26, 33, 40, 48, 41, 34, 27, 20, 13, 6,  7,  14, 21, 28,
                                                  35, 42, 49, 56, 57, 50, 43, 36, 29, 22, 15, 23, 30, 37, 44, 51,
                                                  58, 59, 52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47, 55, 62, 63};

int quantiser(int index) { return 3 + 2 * (index / 8 + index % 8); }

/// basis[x][u] = c(u) cos((2x + 1) u pi / 16) / 2: the columns of the orthonormal DCT.
const std::array<std::array<float, 8>, 8> &dctBasis()
{
  static const auto basis = [] {
    std::array<std::array<float, 8>, 8> b{};
    for (int x = 0; x < 8; ++x)
      for (int u = 0; u < 8; ++u)
        b[x][u] = static_cast<float>((u == 0 ? std::sqrt(0.125) : 0.5) * std::cos((2 * x + 1) * u * M_PI / 16));
    return b;
  }();
  return basis;
}

std::uint8_t clampToByte(double value) { return static_cast<std::uint8_t>(std::clamp(value + 0.5, 0.0, 255.0)); }

/// Dequantises, transforms and writes one block at \p out.
void reconstruct(const std::array<int, 64> &levels, bool has_ac, std::uint8_t *out, int stride)
{
  const auto clampPixel = [](float value) {
    return static_cast<std::uint8_t>(std::clamp(std::lround(value), 0L, 255L));
  };
  if (!has_ac) {
    const std::uint8_t mean = clampPixel(static_cast<float>(levels[0] * quantiser(0)) / 8);
    for (int y = 0; y < 8; ++y)
      std::fill_n(out + y * stride, 8, mean);
    return;
  }
  std::array<float, 64> coefficients{};
  for (int i = 0; i < 64; ++i)
    coefficients[kZigzag[i]] = static_cast<float>(levels[i] * quantiser(kZigzag[i]));
  const auto &basis = dctBasis();
  std::array<float, 64> rows{};
  for (int v = 0; v < 8; ++v)
    for (int x = 0; x < 8; ++x)
      for (int u = 0; u < 8; ++u)
        rows[v * 8 + x] += coefficients[v * 8 + u] * basis[x][u];
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 8; ++x) {
      float sum = 0;
      for (int v = 0; v < 8; ++v)
        sum += rows[v * 8 + x] * basis[y][v];
      out[y * stride + x] = clampPixel(sum);
    }
}

/// The state of one picture while its groups are read.
struct Decoder
{
  UvlcBits bits;
  UvlcResult result;
  int quant = 0;
  int groups = 0; // in the picture
  std::vector<bool> done;

  Decoder(const std::uint8_t *data, std::size_t size) : bits(data, size) {}

  void complain(std::string message)
  {
    if (result.message.empty())
      result.message = std::move(message);
  }

  /// Moves to the next start code on a byte; its number, or nothing at the end.
  std::optional<std::uint32_t> findStartCode()
  {
    const bool padded = bits.peek(static_cast<int>((8 - bits.position() % 8) % 8)) == 0;
    if (!padded)
      complain("bits behind a group");
    bits.alignToByte();
    for (; bits.position() + 22 <= bits.size(); bits.skip(8)) {
      if (const std::uint32_t code = bits.peek(22); (code >> 5) == 1) {
        bits.skip(22);
        return code & 0x1f;
      }
      if (bits.peek(8) != 0)
        complain("bytes behind a group"); // only zeros fill its last word
    }
    return std::nullopt;
  }

  bool readPictureHeader()
  {
    const auto format = bits.read(2);
    const auto resolution = static_cast<int>(bits.read(3));
    const auto type = bits.read(3);
    quant = static_cast<int>(bits.read(5));
    const auto number = bits.read(32);
    if (format < 1 || format > 2 || resolution < 1 || resolution > kLargestResolution || type != 0) {
      complain(fmt::format("picture header: format {}, resolution {}, type {}{}", format, resolution, type, kOnlyUvlc));
      return false;
    }
    YuvPicture &picture = result.picture;
    picture.number = number;
    picture.width = (format == 1 ? 88 : 160) << (resolution - 1);
    picture.height = (format == 1 ? 72 : 120) << (resolution - 1);
    groups = (picture.height + 15) / 16;
    const std::size_t coded_width = (picture.width + 15) / 16 * 16;
    picture.y.assign(coded_width * groups * 16, 0);
    picture.cb.assign(coded_width * groups * 4, 128);
    picture.cr = picture.cb;
    done.assign(static_cast<std::size_t>(groups), false);
    return true;
  }

  bool readMacroblock(int group, int column)
  {
    if (bits.read(1) == 1)
      return true; // not coded: all zero
    const auto flags = bits.read(8);
    if ((flags & 0x80) == 0)
      return false;
    if ((flags & 0x40) != 0) {
      complain("a change of quantiser inside a group");
      return false;
    }
    YuvPicture &picture = result.picture;
    const int stride = (picture.width + 15) / 16 * 16;
    for (int block = 0; block < 6; ++block) {
      const bool has_ac = ((flags >> block) & 1) != 0;
      std::array<int, 64> levels{};
      if (!readUvlcBlock(bits, has_ac, levels))
        return false;
      if (block < 4)
        reconstruct(levels, has_ac,
                    picture.y.data() + (group * 16 + block / 2 * 8) * stride + column * 16 + block % 2 * 8, stride);
      else
        reconstruct(levels, has_ac,
                    (block == 4 ? picture.cb : picture.cr).data() + group * 8 * (stride / 2) + column * 8, stride / 2);
    }
    return true;
  }

  bool readGroup(int group)
  {
    if (quant != kTableQuantiser) {
      complain(fmt::format("group {}: quantiser {}, only {} is known{}", group, quant, kTableQuantiser, kOnlyUvlc));
      return false;
    }
    const int columns = (result.picture.width + 15) / 16;
    for (int column = 0; column < columns; ++column)
      if (!readMacroblock(group, column)) {
        complain(fmt::format("group {}, macroblock {}: not a block", group, column));
        return false;
      }
    return true;
  }

  /// Cuts the planes to the size that is shown.
  void crop()
  {
    YuvPicture &picture = result.picture;
    const auto cut = [](std::vector<std::uint8_t> &plane, std::size_t stride, int width, int height) {
      for (int row = 0; row < height; ++row)
        std::copy_n(plane.begin() + static_cast<std::ptrdiff_t>(row * stride), width,
                    plane.begin() + static_cast<std::ptrdiff_t>(row) * width);
      plane.resize(static_cast<std::size_t>(width) * height);
    };
    const std::size_t stride = (picture.width + 15) / 16 * 16;
    cut(picture.y, stride, picture.width, picture.height);
    cut(picture.cb, stride / 2, (picture.width + 1) / 2, (picture.height + 1) / 2);
    cut(picture.cr, stride / 2, (picture.width + 1) / 2, (picture.height + 1) / 2);
  }
};
} // namespace

void YuvPicture::toGrey(vpImage<unsigned char> &image) const
{
  image.resize(static_cast<unsigned>(height), static_cast<unsigned>(width));
  std::copy(y.begin(), y.end(), image.bitmap);
}

void YuvPicture::toColour(vpImage<vpRGBa> &image) const
{
  image.resize(static_cast<unsigned>(height), static_cast<unsigned>(width));
  const int half = (width + 1) / 2;
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const std::size_t at = static_cast<std::size_t>(v) * width + u;
      const std::size_t colour = static_cast<std::size_t>(v / 2) * half + u / 2;
      const double luma = y[at], blue = cb[colour] - 128.0, red = cr[colour] - 128.0;
      image.bitmap[at] = vpRGBa(clampToByte(luma + 1.402 * red), clampToByte(luma - 0.344136 * blue - 0.714136 * red),
                                clampToByte(luma + 1.772 * blue));
    }
}

UvlcBits::UvlcBits(const std::uint8_t *data, std::size_t size) : m_data(data), m_size_bits(size / 4 * 32) {}

std::uint32_t UvlcBits::bit(std::size_t at) const
{
  if (at >= m_size_bits)
    return 0;
  const std::size_t byte = at / 32 * 4 + 3 - at % 32 / 8;
  return (m_data[byte] >> (7 - at % 8)) & 1u;
}

std::uint32_t UvlcBits::peek(int count) const
{
  std::uint32_t value = 0;
  for (int i = 0; i < count; ++i)
    value = (value << 1) | bit(m_position + static_cast<std::size_t>(i));
  return value;
}

std::uint32_t UvlcBits::read(int count)
{
  const std::uint32_t value = peek(count);
  skip(count);
  return value;
}

int UvlcBits::countZeros()
{
  int zeros = 0;
  while (zeros < 32 && bit(m_position + static_cast<std::size_t>(zeros)) == 0)
    ++zeros;
  skip(zeros + 1);
  return zeros;
}

bool readUvlcBlock(UvlcBits &bits, bool has_ac, std::array<int, 64> &levels)
{
  levels.fill(0);
  levels[0] = static_cast<int>(bits.read(10));
  int position = 0;
  while (has_ac) {
    const int run_zeros = bits.countZeros();
    if (run_zeros > 6)
      return false;
    const int run = run_zeros == 0 ? 0 : (1 << (run_zeros - 1)) + static_cast<int>(bits.read(run_zeros - 1));
    const int level_zeros = bits.countZeros();
    if (level_zeros == 1)
      break;
    if (level_zeros > 10)
      return false;
    const int magnitude =
        level_zeros == 0 ? 1 : (1 << (level_zeros - 1)) + static_cast<int>(bits.read(level_zeros - 1));
    position += run + 1;
    if (position > 63)
      return false;
    levels[static_cast<std::size_t>(position)] = bits.read(1) == 1 ? -magnitude : magnitude;
  }
  return !bits.exhausted();
}

UvlcResult decodeUvlc(const std::uint8_t *data, std::size_t size)
{
  Decoder decoder(data, size);
  UvlcResult &result = decoder.result;
  const auto first = decoder.findStartCode();
  if (!first || *first != 0) {
    decoder.complain("no picture start code");
    return std::move(result);
  }
  if (decoder.bits.position() != 22)
    decoder.complain("bytes before the picture start code");
  if (!decoder.readPictureHeader())
    return std::move(result);

  for (std::optional<std::uint32_t> group = 0; group && *group != kEndOfSequence; group = decoder.findStartCode()) {
    const int index = static_cast<int>(*group);
    if (index > 0)
      decoder.quant = static_cast<int>(decoder.bits.read(5));
    if (index >= decoder.groups || decoder.done[index]) {
      decoder.complain(fmt::format("group {} twice or outside the picture", index));
      continue;
    }
    if (decoder.readGroup(index)) {
      decoder.done[index] = true;
      ++result.gobs;
    }
  }
  if (result.gobs < decoder.groups)
    decoder.complain(fmt::format("{} of {} groups", result.gobs, decoder.groups));
  decoder.crop();
  result.whole = result.message.empty();
  return std::move(result);
}
} // namespace bole
