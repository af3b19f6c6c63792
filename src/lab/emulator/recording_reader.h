// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What `bole record` writes, read back.

#include <bole/vpArDroneGrabber.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace bole
{
struct RecordedPiece
{
  LinkChannel channel = LinkChannel::video; ///< that it came by
  std::int64_t arrival_ns = 0;              ///< host's steady clock
  std::vector<std::uint8_t> bytes;          ///< as received
};

/// Reads raw.bin, which `bole record` writes. A damaged or cut piece is skipped, and the next whole one searched for,
/// until four times the file was summed in vain: a file made so that each of its bytes could be the beginning of a long
/// piece. Law (a test): of a file cut at any byte, every piece that ends before the cut is read.
class RecordingReader
{
public:
  /// Throws vpException when there is no recording in \p folder (or \p folder is no raw.bin).
  explicit RecordingReader(const std::string &folder);
  /// From memory.
  explicit RecordingReader(std::vector<std::uint8_t> bytes);
  /// The next piece; false at the end.
  bool next(RecordedPiece &piece);
  std::size_t skippedBytes() const { return m_skipped; } ///< of damaged pieces

private:
  std::vector<std::uint8_t> m_bytes;
  std::size_t m_at = 0, m_skipped = 0, m_in_vain = 0;
};

/// Generation of the drone that made the recording: what its video looks like.
int recordedGeneration(const std::string &folder);
} // namespace bole
