// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/video_decoder.h"

#include "ardrone/bytes.h"

#include <algorithm>

namespace bole
{
namespace
{
constexpr std::uint8_t kSignature[4] = {'P', 'a', 'V', 'E'};
constexpr std::size_t kShortHeader = 64, kLongHeader = 68;
constexpr std::uint32_t kLargestPayload = 1u << 20; // a 720p key frame is under 200 kB
constexpr std::uint16_t kLargestSide = 2048;
} // namespace

bool PaveHeader::isPlausible() const
{
  const auto side = [](std::uint16_t pixels) { return pixels >= 16 && pixels <= kLargestSide; };
  return version >= 1 && version <= 3 && codec == 4 && (header_size == kShortHeader || header_size == kLongHeader) &&
         payload_size > 0 && payload_size <= kLargestPayload && side(coded_width) && side(coded_height) &&
         side(display_width) && side(display_height) && display_width <= coded_width &&
         display_height <= coded_height && frame_type <= PaveFrameType::headers;
}

std::optional<PaveHeader> parsePaveHeader(const std::uint8_t *data, std::size_t size)
{
  if (size < kShortHeader || !std::equal(kSignature, kSignature + 4, data))
    return std::nullopt;
  PaveHeader header;
  header.version = data[4];
  header.codec = data[5];
  header.header_size = readLittleEndian<std::uint16_t>(data + 6);
  header.payload_size = readLittleEndian<std::uint32_t>(data + 8);
  header.coded_width = readLittleEndian<std::uint16_t>(data + 12);
  header.coded_height = readLittleEndian<std::uint16_t>(data + 14);
  header.display_width = readLittleEndian<std::uint16_t>(data + 16);
  header.display_height = readLittleEndian<std::uint16_t>(data + 18);
  header.frame_number = readLittleEndian<std::uint32_t>(data + 20);
  header.timestamp_ms = readLittleEndian<std::uint32_t>(data + 24);
  header.frame_type = static_cast<PaveFrameType>(data[30]);
  header.stream_position = readLittleEndian<std::uint32_t>(data + 32);
  header.stream_id = readLittleEndian<std::uint16_t>(data + 40);
  header.header1_size = data[44];
  header.header2_size = data[45];
  header.advertised_size = readLittleEndian<std::uint32_t>(data + 48);
  if (!header.isPlausible())
    return std::nullopt;
  return header;
}

void PaveParser::push(const std::uint8_t *data, std::size_t size)
{
  if (m_begin > 0 && m_begin >= m_buffer.size() / 2) {
    m_buffer.erase(m_buffer.begin(), m_buffer.begin() + static_cast<std::ptrdiff_t>(m_begin));
    m_begin = 0;
  }
  m_buffer.insert(m_buffer.end(), data, data + size);
}

void PaveParser::reset()
{
  m_buffer.clear();
  m_begin = 0;
  m_gap = false;
  m_last_number.reset();
}

std::size_t PaveParser::findHeader(std::size_t from) const
{
  // A signature at the very end may be the front of a header still on its way: stop there.
  auto at = m_buffer.begin() + static_cast<std::ptrdiff_t>(from);
  for (;; ++at) {
    at = std::search(at, m_buffer.end(), kSignature, kSignature + 4);
    const auto position = static_cast<std::size_t>(at - m_buffer.begin());
    if (at == m_buffer.end())
      return std::max(from, m_buffer.size() - std::min<std::size_t>(3, m_buffer.size()));
    const std::size_t left = m_buffer.size() - position;
    if (left < kShortHeader || parsePaveHeader(m_buffer.data() + position, left))
      return position;
  }
}

void PaveParser::skip(std::size_t count)
{
  if (count == 0)
    return;
  m_skipped_bytes += count;
  m_begin += count;
  if (!m_gap)
    ++m_resyncs;
  m_gap = true;
}

std::optional<PaveFrame> PaveParser::next()
{
  for (;;) {
    skip(findHeader(m_begin) - m_begin);
    const std::size_t left = m_buffer.size() - m_begin;
    const auto header = parsePaveHeader(m_buffer.data() + m_begin, left);
    if (!header)
      return std::nullopt;
    const std::size_t frame_size = header->header_size + header->payload_size;
    // The length may be damaged: a header inside the payload shows where the next frame really begins.
    const std::size_t end = std::min(frame_size, left);
    const std::size_t inner = findHeader(m_begin + header->header_size) - m_begin;
    if (inner + kShortHeader <= end && parsePaveHeader(m_buffer.data() + m_begin + inner, left - inner)) {
      skip(inner);
      continue;
    }
    if (left < frame_size)
      return std::nullopt;

    PaveFrame frame;
    frame.header = *header;
    const auto payload = m_buffer.begin() + static_cast<std::ptrdiff_t>(m_begin + header->header_size);
    frame.payload.assign(payload, payload + header->payload_size);
    frame.after_gap = m_gap || (m_last_number && header->frame_number != *m_last_number + 1);
    m_last_number = header->frame_number;
    m_gap = false;
    m_begin += frame_size;
    ++m_frames;
    return frame;
  }
}
} // namespace bole
