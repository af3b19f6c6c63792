// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/codec.h"
#include "input/frame_builder.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <opencv2/core/types.hpp>
#include <optional>

extern "C" {
#include <libavutil/crc.h>
}

namespace bole
{
namespace
{
using Bytes = std::vector<unsigned char>;

constexpr std::uint64_t kLargestSide = std::uint64_t{1} << 30; // px, of what a header may say

std::uint32_t bigEndian32(const unsigned char *p)
{
  return (std::uint32_t(p[0]) << 24) | (std::uint32_t(p[1]) << 16) | (std::uint32_t(p[2]) << 8) | p[3];
}

/// Walks the chunks of a PNG: all of them whole, each with its checksum, the last one IEND.
std::string pngFault(const Bytes &bytes)
{
  static const AVCRC *const kCrc = av_crc_get_table(AV_CRC_32_IEEE_LE);
  std::size_t at = 8;
  while (at + 12 <= bytes.size()) {
    const std::size_t length = bigEndian32(&bytes[at]);
    if (length > bytes.size() - at - 12)
      break;
    if (~av_crc(kCrc, ~0u, &bytes[at + 4], length + 4) != bigEndian32(&bytes[at + 8 + length]))
      return fmt::format("checksum error in the PNG chunk at byte {}", at);
    if (std::memcmp(&bytes[at + 4], "IEND", 4) == 0)
      return {};
    at += 12 + length;
  }
  return fmt::format("truncated PNG of {} bytes", bytes.size());
}

/// A JPEG ends in the marker FF D9, perhaps with padding behind it.
std::string jpegFault(const Bytes &bytes)
{
  const std::array<unsigned char, 2> end_marker{{0xFF, 0xD9}};
  const std::size_t tail = std::min<std::size_t>(bytes.size(), 4096);
  const auto first = bytes.end() - static_cast<std::ptrdiff_t>(tail);
  const bool has_end = std::search(first, bytes.end(), end_marker.begin(), end_marker.end()) != bytes.end();
  return has_end ? std::string() : fmt::format("truncated JPEG of {} bytes", bytes.size());
}

/// Reads a TIFF's first directory in its byte order: all strips or tiles must be in the file. Size and offsets may lie.
class TiffDirectory
{
public:
  explicit TiffDirectory(const Bytes &bytes) : m_bytes(bytes), m_is_little(bytes[0] == 'I') {}

  static bool isOne(const Bytes &bytes)
  {
    return bytes.size() >= 8 && ((bytes[0] == 'I' && bytes[1] == 'I' && bytes[2] == 42) ||
                                 (bytes[0] == 'M' && bytes[1] == 'M' && bytes[3] == 42));
  }

  cv::Size size() const
  {
    cv::Size size(0, 0);
    const std::uint64_t directory = number(4, 4), entries = number(directory, 2);
    for (std::uint64_t at = directory + 2; at + 12 <= m_bytes.size() && at < directory + 2 + 12 * entries; at += 12)
      if (const std::uint64_t tag = number(at, 2); tag == 256 || tag == 257)
        (tag == 256 ? size.width : size.height) = static_cast<int>(std::min(value(at, 0), kLargestSide));
    return size;
  }

  std::string fault() const
  {
    const std::uint64_t directory = number(4, 4);
    const std::uint64_t entries = number(directory, 2);
    std::uint64_t end = directory + 2 + 12 * entries;
    std::uint64_t offsets = 0, counts = 0;
    for (std::uint64_t at = directory + 2; at + 12 <= m_bytes.size() && at < directory + 2 + 12 * entries; at += 12) {
      const std::uint64_t tag = number(at, 2);
      if (tag == 273 || tag == 324)
        offsets = at;
      if (tag == 279 || tag == 325)
        counts = at;
    }
    if (offsets != 0 && counts != 0)
      for (std::uint64_t k = 0; k < std::min(number(offsets + 4, 4), number(counts + 4, 4)) && end <= m_bytes.size();
           ++k)
        end = std::max(end, value(offsets, k) + value(counts, k));
    return end > m_bytes.size() ? fmt::format("truncated TIFF of {} bytes", m_bytes.size()) : std::string();
  }

private:
  std::uint64_t number(std::uint64_t at, int size) const
  {
    std::uint64_t result = 0;
    for (int i = 0; i < size; ++i) {
      const std::uint64_t from = at + static_cast<std::uint64_t>(m_is_little ? size - 1 - i : i);
      result = result << 8 | (from < m_bytes.size() ? m_bytes[from] : 0xFF);
    }
    return result;
  }
  /// The k-th value of the entry at \p entry, which is in the entry itself when it fits into four bytes.
  std::uint64_t value(std::uint64_t entry, std::uint64_t k) const
  {
    const int size = number(entry + 2, 2) == 3 ? 2 : 4;
    const bool is_inside = number(entry + 4, 4) * static_cast<std::uint64_t>(size) <= 4;
    return number((is_inside ? entry + 8 : number(entry + 8, 4)) + k * static_cast<std::uint64_t>(size), size);
  }
  const Bytes &m_bytes;
  bool m_is_little;
};

/// Size by the header of a PNM: "P5 width height", with comments between.
std::optional<cv::Size> pnmSize(const Bytes &bytes)
{
  std::uint64_t sides[2] = {0, 0};
  std::size_t at = 2;
  for (std::uint64_t &side : sides) {
    for (; at < bytes.size() && (std::isspace(bytes[at]) != 0 || bytes[at] == '#'); ++at)
      if (bytes[at] == '#')
        at = static_cast<std::size_t>(std::find(bytes.begin() + static_cast<std::ptrdiff_t>(at), bytes.end(), '\n') -
                                      bytes.begin());
    if (at >= bytes.size() || std::isdigit(bytes[at]) == 0)
      return std::nullopt;
    for (; at < bytes.size() && std::isdigit(bytes[at]) != 0; ++at)
      side = std::min(10 * side + static_cast<std::uint64_t>(bytes[at] - '0'), kLargestSide);
  }
  return cv::Size(static_cast<int>(sides[0]), static_cast<int>(sides[1]));
}

/// Size by the header of a PNG, BMP, JPEG, TIFF or PNM, before anything is allocated for it; nothing for what is none
/// of these or hides its size, which is not decoded.
std::optional<cv::Size> sizeOf(const Bytes &bytes)
{
  if (TiffDirectory::isOne(bytes))
    return TiffDirectory(bytes).size();
  if (bytes.size() >= 8 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6')
    return pnmSize(bytes);
  const auto big16 = [&bytes](std::size_t at) { return static_cast<int>(bytes[at]) << 8 | bytes[at + 1]; };
  if (bytes.size() >= 24 && bytes[0] == 0x89 && bytes[1] == 'P')
    return cv::Size(static_cast<int>(std::min(bigEndian32(&bytes[16]), 1u << 30)),
                    static_cast<int>(std::min(bigEndian32(&bytes[20]), 1u << 30)));
  if (bytes.size() >= 26 && bytes[0] == 'B' && bytes[1] == 'M') {
    std::int32_t size[2];
    std::memcpy(size, &bytes[18], sizeof size);
    return cv::Size(std::abs(size[0] % (1 << 30)), std::abs(size[1] % (1 << 30)));
  }
  if (bytes[0] == 0xFF && bytes.size() > 4 && bytes[1] == 0xD8)
    for (std::size_t at = 2, length = 0; at + 9 < bytes.size() && bytes[at] == 0xFF; at += length) {
      const int marker = bytes[at + 1];
      length = marker == 0xFF ? 1 : 2 + static_cast<std::size_t>(big16(at + 2)); // any number of FF may stand in front
      if (marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC)
        return cv::Size(big16(at + 7), big16(at + 5));
    }
  return std::nullopt;
}

std::string containerFault(const Bytes &bytes)
{
  const std::array<unsigned char, 8> png{{0x89, 'P', 'N', 'G', 0x0D, 0x0A, 0x1A, 0x0A}};
  if (bytes.empty())
    return "empty file";
  if (bytes.size() >= png.size() && std::equal(png.begin(), png.end(), bytes.begin()))
    return pngFault(bytes);
  if (bytes.size() >= 3 && bytes[0] == 0xFF && bytes[1] == 0xD8 && bytes[2] == 0xFF)
    return jpegFault(bytes);
  if (TiffDirectory::isOne(bytes))
    return TiffDirectory(bytes).fault();
  return {};
}

ImageFile broken(FrameStatus status, const std::string &path, const std::string &reason)
{
  return {status, fmt::format("{}: {}", path, reason), {}};
}
} // namespace

ImageFile readImageFile(const std::string &path, int width, int height)
{
  constexpr std::uintmax_t kLargestFile = std::uintmax_t{256} << 20; // bytes
  constexpr double kMostPixels = 1e8;
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error))
    return broken(FrameStatus::missing, path,
                  std::filesystem::exists(path, error) ? "is no file of an image" : "no such image");
  const std::uintmax_t size_of_file = std::filesystem::file_size(path, error);
  if (!error && size_of_file > kLargestFile)
    return broken(FrameStatus::corrupt, path, "larger than 256 MB");
  std::ifstream file(path, std::ios::binary);
  Bytes bytes(error ? 0 : static_cast<std::size_t>(size_of_file));
  file.read(reinterpret_cast<char *>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(file.gcount()));
  if (!file.is_open() || file.bad())
    return broken(FrameStatus::missing, path, "cannot be read");
  const std::string fault = containerFault(bytes);
  if (!fault.empty())
    return broken(FrameStatus::corrupt, path, fault);
  const auto size = sizeOf(bytes);
  if (!size)
    return broken(FrameStatus::corrupt, path, "cannot be decoded, must be a PNG, JPEG, PNM, BMP or TIFF");
  if (width > 0 && *size != cv::Size(width, height))
    return broken(FrameStatus::resized, path,
                  fmt::format("image of {}x{} px, must be {}x{}", size->width, size->height, width, height));
  if (static_cast<double>(size->width) * size->height > kMostPixels)
    return broken(
        FrameStatus::corrupt, path,
        fmt::format("image of {}x{} px, must be at most {:g} pixels", size->width, size->height, kMostPixels));

  ImageFile result;
  if (!decodeGrey(bytes, result.image))
    return broken(FrameStatus::corrupt, path, "cannot be decoded");
  const cv::Size decoded(static_cast<int>(result.image.getWidth()), static_cast<int>(result.image.getHeight()));
  if (decoded != *size) // a second header further on
    return broken(
        FrameStatus::corrupt, path,
        fmt::format("two sizes: {}x{} and {}x{} px", size->width, size->height, decoded.width, decoded.height));
  return result;
}
} // namespace bole
