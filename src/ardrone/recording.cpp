// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/flight_folder.h"

#include "ardrone/bytes.h"
#include "geometry/failure.h"
#include "input/regular_file.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fmt/format.h>
#include <unistd.h>
#include <utility>

extern "C" {
#include <libavutil/crc.h>
}

namespace bole
{
namespace
{
const std::string kTitle = "bole raw flight 1\n";
constexpr std::uint32_t kMagic = 0x45434542;
constexpr std::size_t kHead = 20, kTail = 4, kLargestPiece = 1 << 20;

/// CRC-32 of IEEE 802.3.
std::uint32_t crc32(const std::uint8_t *data, std::size_t size)
{
  return ~av_crc(av_crc_get_table(AV_CRC_32_IEEE_LE), ~0u, data, size);
}

std::filesystem::path rawPath(const std::string &folder)
{
  const std::filesystem::path path(folder);
  return std::filesystem::is_directory(path) ? path / "raw.bin" : path;
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
  piece.reserve(kHead + size + kTail);
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

RecordingReader::RecordingReader(const std::string &folder)
{
  const auto path = rawPath(folder);
  constexpr std::uintmax_t kLargestFile = std::uintmax_t{4} << 30; // bytes: hours of flight
  std::ifstream file = openRegularFile(path.string());
  const std::uintmax_t size = std::filesystem::file_size(path);
  if (size > kLargestFile)
    throw ioError("{}: {} bytes, must be at most {}", path.string(), size, kLargestFile);
  m_bytes.resize(static_cast<std::size_t>(size));
  file.read(reinterpret_cast<char *>(m_bytes.data()), static_cast<std::streamsize>(size));
  m_bytes.resize(static_cast<std::size_t>(file.gcount()));
  if (m_bytes.size() < kTitle.size() || !std::equal(kTitle.begin(), kTitle.end(), m_bytes.begin()))
    throw ioError("{}:1: the first line must be \"{}\"", path.string(), kTitle.substr(0, kTitle.size() - 1));
  m_at = kTitle.size();
}

RecordingReader::RecordingReader(std::vector<std::uint8_t> bytes) : m_bytes(std::move(bytes)) {}

bool RecordingReader::next(RecordedPiece &piece)
{
  const std::size_t most_in_vain = 4 * m_bytes.size() + kLargestPiece; // of bytes whose sum is wrong
  for (; m_at + kHead + kTail <= m_bytes.size() && m_in_vain < most_in_vain; ++m_at, ++m_skipped) {
    const std::uint8_t *p = m_bytes.data() + m_at;
    if (readLittleEndian<std::uint32_t>(p) != kMagic)
      continue;
    const std::size_t size = readLittleEndian<std::uint32_t>(p + 16);
    const std::size_t left = m_bytes.size() - m_at;
    if (p[4] < 1 || p[4] > 3 || size > kLargestPiece || kHead + size + kTail > left)
      continue;
    if (readLittleEndian<std::uint32_t>(p + kHead + size) != crc32(p, kHead + size)) {
      m_in_vain += size;
      continue;
    }
    piece.channel = static_cast<LinkChannel>(p[4]);
    piece.arrival_ns = readLittleEndian<std::int64_t>(p + 8);
    piece.bytes.assign(p + kHead, p + kHead + size);
    m_at += kHead + size + kTail;
    return true;
  }
  m_skipped += m_bytes.size() - m_at;
  m_at = m_bytes.size();
  return false;
}

int recordedGeneration(const std::string &folder)
{
  RecordingReader reader(folder);
  for (RecordedPiece piece; reader.next(piece);)
    if (piece.channel == LinkChannel::video && !piece.bytes.empty()) {
      static constexpr std::array<std::uint8_t, 4> signature = {'P', 'a', 'V', 'E'};
      const auto end =
          piece.bytes.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(piece.bytes.size(), 4096));
      if (std::search(piece.bytes.begin(), end, signature.begin(), signature.end()) != end)
        return 2;
      if (piece.bytes.size() > 3 && piece.bytes[2] == 0 && piece.bytes[3] == 0)
        return 1; // the start code of a picture
    }
  return 2;
}
} // namespace bole
