// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The drone's video from bytes to pictures with a status; knows nothing of sockets or clocks.

#include "ardrone/uvlc.h"
#include "input/codec.h"
#include <bole/ardrone_wire.h>
#include <bole/vpArDroneGrabber.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace bole
{
// PaVE, the envelope of the AR.Drone 2's video: a stream of bytes in, whole frames out.

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

struct DecodedFrame
{
  FrameStatus status = FrameStatus::ok;
  std::string message;                       ///< why the status is not ok
  YuvPicture picture;                        ///< empty when nothing could be decoded
  std::uint32_t number = 0;                  ///< as the drone counts
  std::optional<std::uint32_t> timestamp_ms; ///< PaVE; an AR.Drone 1 sends none
  /// Hardly different from the picture that last was: the camera stands still, or is frozen (the encoder's refinement
  /// of one picture changes block means by up to 0.65 grey levels, a slow flight by several).
  bool unchanged = false;
};

/// Decodes the video of either generation.
///
/// AR.Drone 2: frames that refer to others are `corrupt` from a gap or a damaged frame on until the
/// next key frame. When several frames have piled up, those in front of the newest key frame are
/// skipped and counted. AR.Drone 1: each datagram is a picture by itself. Both: a picture with the
/// pixels of the one before is `stale`, one of another size than the first `resized`.
///
/// Neither stream has a checksum: damage that still reads as a picture is not seen here (see the
/// README). Not thread-safe.
class DroneVideoDecoder
{
public:
  using Counters = VideoCounters;

  /// \param generation 1 or 2.
  explicit DroneVideoDecoder(int generation);
  /// Bytes of the stream (2) or one datagram (1), and the frames that they complete.
  std::vector<DecodedFrame> decode(const std::uint8_t *data, std::size_t size);
  /// A datagram that comes too fast to be looked at.
  void refuse() { ++m_counters.refused; }
  /// For a new connection: the next frame must be a key frame.
  void restart();
  const Counters &counters() const { return m_counters; }

private:
  DecodedFrame decodePave(const PaveFrame &frame);
  std::string decodeH264(const PaveFrame &frame, YuvPicture &picture);
  void judge(DecodedFrame &frame);

  int m_generation;
  std::optional<std::uint32_t> m_last_number; ///< of an AR.Drone 1's pictures
  PaveParser m_parser;
  PictureDecoder m_h264 = PictureDecoder::h264();
  bool m_needs_key = true;
  YuvPicture m_last; ///< the last whole picture
  int m_width = 0, m_height = 0;
  Counters m_counters;
};
} // namespace bole
