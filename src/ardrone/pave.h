// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// PaVE, the envelope of the AR.Drone 2's video: a stream of bytes in, whole frames out.

#include <bole/ardrone_wire.h>

namespace bole
{
/// The header at \p data, or nothing: too short, another signature, or implausible fields.
std::optional<PaveHeader> parsePaveHeader(const std::uint8_t *data, std::size_t size);

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
