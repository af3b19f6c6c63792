// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// PaVE, the envelope of the AR.Drone 2's video: a stream of bytes in, whole frames out.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace bole
{
enum class PaveFrameType : std::uint8_t
{
  unknown = 0,
  idr = 1,
  i = 2,
  p = 3,
  headers = 4
};

/// The fields of a PaVE header that anyone reads. All little-endian on the wire; the header is 64
/// or 68 bytes long by firmware and says so itself.
struct PaveHeader
{
  std::uint8_t version = 2;
  std::uint8_t codec = 4; ///< 4 = H.264
  std::uint16_t header_size = 64;
  std::uint32_t payload_size = 0;
  std::uint16_t coded_width = 0, coded_height = 0;     ///< [px], multiples of 16
  std::uint16_t display_width = 0, display_height = 0; ///< [px]
  std::uint32_t frame_number = 0;
  std::uint32_t timestamp_ms = 0; ///< drone's clock, wraps after 49.7 days
  PaveFrameType frame_type = PaveFrameType::unknown;
  std::uint32_t stream_position = 0; ///< payload bytes sent before this frame, low word
  std::uint16_t stream_id = 0;
  std::uint8_t header1_size = 0, header2_size = 0; ///< [byte] SPS and PPS in front of a key frame
  std::uint32_t advertised_size = 0;

  /// True when the fields are such as a drone can send: the signature alone appears in payloads by chance.
  bool isPlausible() const;
};

/// The header at \p data, or nothing: too short, another signature, or implausible fields.
std::optional<PaveHeader> parsePaveHeader(const std::uint8_t *data, std::size_t size);

/// The bytes of \p header, header_size long.
std::vector<std::uint8_t> encodePaveHeader(const PaveHeader &header);

struct PaveFrame
{
  PaveHeader header;
  std::vector<std::uint8_t> payload;
  bool after_gap = false; ///< bytes were skipped, or a frame number is missing, just before this frame
};

/// Cuts a byte stream into PaVE frames and finds its way again after damage.
///
/// Idea: keep the bytes not yet used; when the front is not a plausible header, search for the next signature that is
/// one, and say so in the next frame (after_gap). A damaged length cannot swallow the stream: payloads above 1 MiB are
/// implausible, and a frame whose successor is not a header is searched for a header inside it.
///
/// Laws (each a test): how the stream is cut into push() calls does not matter; a frame pushed
/// whole comes out; any input terminates. Cost: linear in the bytes. Not thread-safe.
class PaveParser
{
public:
  void push(const std::uint8_t *data, std::size_t size);
  /// The next whole frame, or nothing until more bytes come.
  std::optional<PaveFrame> next();
  /// Forgets bytes and numbers: for a new connection.
  void reset();

  std::size_t frames() const { return m_frames; }
  std::size_t skippedBytes() const { return m_skipped_bytes; }
  std::size_t resyncs() const { return m_resyncs; }

private:
  std::size_t findHeader(std::size_t from) const;
  void skip(std::size_t count);

  std::vector<std::uint8_t> m_buffer;
  std::size_t m_begin = 0; ///< first byte of m_buffer not yet used
  std::size_t m_frames = 0, m_skipped_bytes = 0, m_resyncs = 0;
  bool m_gap = false;
  std::optional<std::uint32_t> m_last_number;
};
} // namespace bole
