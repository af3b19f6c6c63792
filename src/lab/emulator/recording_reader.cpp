// SPDX-License-Identifier: GPL-2.0-or-later
#include "emulator/recording_reader.h"

#include "emulator/emulator.h"
#include "support/text.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
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

/// The 32 bits at \p p, the least significant byte first.
std::uint32_t wordAt(const std::uint8_t *p)
{
  return p[0] | std::uint32_t{p[1]} << 8 | std::uint32_t{p[2]} << 16 | std::uint32_t{p[3]} << 24;
}

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

RecordingReader::RecordingReader(const std::string &folder)
{
  const auto path = rawPath(folder);
  constexpr std::uintmax_t kLargestFile = std::uintmax_t{4} << 30; // bytes: hours of flight
  if (!std::filesystem::exists(path))
    throw ioError("{}: no such file", path.string());
  if (!std::filesystem::is_regular_file(path))
    throw ioError("{}: is a {}, must be a file", path.string(),
                  std::filesystem::is_directory(path) ? "folder" : "pipe, socket or device");
  std::ifstream file(path, std::ios::binary);
  if (!file)
    throw ioError("{}: cannot be read: {}", path.string(), std::strerror(errno));
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
    if (wordAt(p) != kMagic)
      continue;
    const std::size_t size = wordAt(p + 16);
    const std::size_t left = m_bytes.size() - m_at;
    if (p[4] < 1 || p[4] > 3 || size > kLargestPiece || kHead + size + kTail > left)
      continue;
    if (wordAt(p + kHead + size) != crc32(p, kHead + size)) {
      m_in_vain += size;
      continue;
    }
    piece.channel = static_cast<LinkChannel>(p[4]);
    piece.arrival_ns = static_cast<std::int64_t>(std::uint64_t{wordAt(p + 12)} << 32 | wordAt(p + 8));
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

namespace
{
class RecordingFeed : public PacketFeed
{
public:
  explicit RecordingFeed(const std::string &folder) : m_reader(folder), m_generation(recordedGeneration(folder)) {}

  int generation() const override { return m_generation; }
  double frameRateHz() const override { return m_generation == 1 ? 15 : 30; }
  bool next(FeedPacket &packet) override
  {
    RecordedPiece piece;
    if (!m_reader.next(piece))
      return false;
    if (m_first_ns < 0)
      m_first_ns = m_last_ns = piece.arrival_ns;
    m_last_ns = std::max(m_last_ns, piece.arrival_ns); // two threads wrote: nearly in order
    packet = {};
    packet.sent_ns = packet.stamp_ns = m_last_ns - m_first_ns;
    packet.bytes = std::move(piece.bytes);
    packet.kind = piece.channel == LinkChannel::video     ? FeedPacket::Kind::raw_video
                  : piece.channel == LinkChannel::navdata ? FeedPacket::Kind::raw_navdata
                                                          : FeedPacket::Kind::video_connected;
    if (packet.kind == FeedPacket::Kind::video_connected && std::exchange(m_is_first_connection, false))
      packet.sent_ns = 0;
    return true;
  }

private:
  RecordingReader m_reader;
  int m_generation;
  std::int64_t m_first_ns = -1, m_last_ns = 0;
  bool m_is_first_connection = true;
};
} // namespace

std::unique_ptr<PacketFeed> makeRecordingFeed(const std::string &folder)
{
  return std::make_unique<RecordingFeed>(folder);
}
} // namespace bole
