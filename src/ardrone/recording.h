// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Flights as they came off the air: raw bytes with their times, in a form that survives being cut anywhere.

#include "ardrone/drone_link.h"

#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

namespace bole
{
/// One received piece.
struct RecordedPiece
{
  LinkChannel channel = LinkChannel::video;
  std::int64_t arrival_ns = 0; ///< host's steady clock
  std::vector<std::uint8_t> bytes;
};

/// Writes `raw.bin`: a line of text that names the form and the generation, then pieces of `u32 0x45434542 ("BECE"), u8
/// channel, 3 reserved, i64 arrival [ns], u32 size, bytes, u32 CRC-32` of all before, little-endian. Each piece is one
/// write(), so a killed process leaves whole pieces but for the last, which the reader drops. Thread-safe.
class RecordingWriter
{
public:
  /// Creates \p folder and raw.bin in it; throws vpException when it cannot, or when there is a recording already.
  explicit RecordingWriter(const std::string &folder);
  ~RecordingWriter();
  RecordingWriter(const RecordingWriter &) = delete;
  RecordingWriter &operator=(const RecordingWriter &) = delete;

  void write(LinkChannel channel, std::int64_t arrival_ns, const std::uint8_t *data, std::size_t size);
  std::size_t bytes() const;
  /// Not empty when the disk refused something: what, first time.
  std::string error() const;

private:
  mutable std::mutex m_mutex;
  int m_descriptor = -1;
  std::string m_path, m_error;
  std::size_t m_bytes = 0;
};

/// Reads raw.bin. A damaged or cut piece is skipped, and the next whole one searched for, until four times the file was
/// summed in vain: a file made so that each of its bytes could be the beginning of a long piece.
/// Law (a test): of a file cut at any byte, every piece that ends before the cut is read.
class RecordingReader
{
public:
  /// Throws vpException when there is no recording in \p folder (or \p folder is no raw.bin).
  explicit RecordingReader(const std::string &folder);
  /// From memory, for the fuzzer.
  explicit RecordingReader(std::vector<std::uint8_t> bytes);
  bool next(RecordedPiece &piece);
  std::size_t skippedBytes() const { return m_skipped; }

private:
  std::vector<std::uint8_t> m_bytes;
  std::size_t m_at = 0, m_skipped = 0, m_in_vain = 0;
};

/// Generation of the drone that made the recording: what its video looks like.
int recordedGeneration(const std::string &folder);
} // namespace bole
