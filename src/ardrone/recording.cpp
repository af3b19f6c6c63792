// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/flight_folder.h"

#include "ardrone/bytes.h"
#include "geometry/failure.h"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fmt/format.h>
#include <unistd.h>

extern "C" {
#include <libavutil/crc.h>
}

namespace bole
{
namespace
{
const std::string kTitle = "bole raw flight 1\n";
constexpr std::uint32_t kMagic = 0x45434542;

/// CRC-32 of IEEE 802.3.
std::uint32_t crc32(const std::uint8_t *data, std::size_t size)
{
  return ~av_crc(av_crc_get_table(AV_CRC_32_IEEE_LE), ~0u, data, size);
}
} // namespace

RecordingWriter::RecordingWriter(const std::string &folder)
{
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  m_path = (std::filesystem::path(folder) / "raw.bin").string();
  m_descriptor = ::open(m_path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0644);
  if (m_descriptor < 0)
    throw ioError("{}: {}", m_path, std::strerror(errno));
  if (::write(m_descriptor, kTitle.data(), kTitle.size()) != static_cast<ssize_t>(kTitle.size()))
    throw ioError("{}: {}", m_path, std::strerror(errno));
  m_bytes = kTitle.size();
}

RecordingWriter::~RecordingWriter()
{
  ::fsync(m_descriptor);
  ::close(m_descriptor);
}

void RecordingWriter::write(LinkChannel channel, std::int64_t arrival_ns, const std::uint8_t *data, std::size_t size)
{
  std::vector<std::uint8_t> piece;
  piece.reserve(20 + size + 4);
  appendLittleEndian(piece, kMagic);
  piece.push_back(static_cast<std::uint8_t>(channel));
  piece.resize(8, 0);
  appendLittleEndian(piece, arrival_ns);
  appendLittleEndian(piece, static_cast<std::uint32_t>(size));
  piece.insert(piece.end(), data, data + size);
  appendLittleEndian(piece, crc32(piece.data(), piece.size()));
  const std::lock_guard<std::mutex> lock(m_mutex);
  const ssize_t written = ::write(m_descriptor, piece.data(), piece.size());
  if (written != static_cast<ssize_t>(piece.size()) && m_error.empty())
    m_error = fmt::format("{}: {}", m_path, written < 0 ? std::strerror(errno) : "the disk is full");
  m_bytes += written > 0 ? static_cast<std::size_t>(written) : 0;
}

std::size_t RecordingWriter::bytes() const
{
  const std::lock_guard<std::mutex> lock(m_mutex);
  return m_bytes;
}

std::string RecordingWriter::error() const
{
  const std::lock_guard<std::mutex> lock(m_mutex);
  return m_error;
}
} // namespace bole
