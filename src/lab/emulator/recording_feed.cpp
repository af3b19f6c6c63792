// SPDX-License-Identifier: GPL-2.0-or-later
#include "emulator/emulator.h"
#include "emulator/recording_reader.h"

#include <algorithm>
#include <utility>

namespace bole
{
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
