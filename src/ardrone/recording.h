// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Flights as they came off the air: raw bytes with their times, in a form that survives being cut anywhere.

#include <bole/ardrone_wire.h>

#include <mutex>

namespace bole
{
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
} // namespace bole
