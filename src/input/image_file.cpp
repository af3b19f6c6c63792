// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/image_file.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>

namespace bole
{
namespace
{
using Bytes = std::vector<unsigned char>;

std::array<std::uint32_t, 256> crcTable()
{
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t n = 0; n < 256; ++n) {
    std::uint32_t c = n;
    for (int k = 0; k < 8; ++k)
      c = (c & 1) ? 0xEDB88320u ^ (c >> 1) : c >> 1;
    table[n] = c;
  }
  return table;
}

std::uint32_t crc32(const unsigned char *data, std::size_t size)
{
  static const auto kTable = crcTable();
  std::uint32_t c = 0xFFFFFFFFu;
  for (std::size_t i = 0; i < size; ++i)
    c = kTable[(c ^ data[i]) & 0xFF] ^ (c >> 8);
  return ~c;
}

std::uint32_t bigEndian32(const unsigned char *p)
{
  return (std::uint32_t(p[0]) << 24) | (std::uint32_t(p[1]) << 16) | (std::uint32_t(p[2]) << 8) | p[3];
}

/// Walks the chunks of a PNG: all of them whole, each with its checksum, the last one IEND.
std::string pngFault(const Bytes &bytes)
{
  std::size_t at = 8;
  while (at + 12 <= bytes.size()) {
    const std::size_t length = bigEndian32(&bytes[at]);
    if (length > bytes.size() - at - 12)
      break;
    if (crc32(&bytes[at + 4], length + 4) != bigEndian32(&bytes[at + 8 + length]))
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

std::string containerFault(const Bytes &bytes)
{
  const std::array<unsigned char, 8> png{{0x89, 'P', 'N', 'G', 0x0D, 0x0A, 0x1A, 0x0A}};
  if (bytes.empty())
    return "empty file";
  if (bytes.size() >= png.size() && std::equal(png.begin(), png.end(), bytes.begin()))
    return pngFault(bytes);
  if (bytes.size() >= 3 && bytes[0] == 0xFF && bytes[1] == 0xD8 && bytes[2] == 0xFF)
    return jpegFault(bytes);
  return {};
}

ImageFile broken(FrameStatus status, const std::string &path, const std::string &reason)
{
  return {status, fmt::format("{}: {}", path, reason), {}};
}
} // namespace

ImageFile readImageFile(const std::string &path)
{
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error))
    return broken(FrameStatus::missing, path, "no such image");
  std::ifstream file(path, std::ios::binary);
  const Bytes bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  if (!file.is_open() || file.bad())
    return broken(FrameStatus::missing, path, "cannot be read");
  const std::string fault = containerFault(bytes);
  if (!fault.empty())
    return broken(FrameStatus::corrupt, path, fault);

  cv::Mat grey;
  try {
    grey = cv::imdecode(bytes, cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
  }
  catch (const cv::Exception &) {
    grey.release();
  }
  if (grey.empty())
    return broken(FrameStatus::corrupt, path, "cannot be decoded");
  ImageFile result;
  result.image.resize(static_cast<unsigned>(grey.rows), static_cast<unsigned>(grey.cols));
  cv::Mat target(grey.rows, grey.cols, CV_8UC1, result.image.bitmap);
  grey.copyTo(target);
  return result;
}
} // namespace bole
