// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a drone's video link does to a picture: H.264 at a low bit rate.

#include <memory>
#include <visp3/core/vpImage.h>

namespace bole
{
/// Encodes each picture as the drone does (baseline profile, no delay, a key frame every 30) and
/// decodes it again, by libavcodec. Same pictures, same results: one thread.
class H264Link
{
public:
  /// \param width, height even [px]; \param kbps 50 to 20000. Throws vpException where libavcodec has no H.264 encoder.
  H264Link(int width, int height, double rate_hz, double kbps);
  ~H264Link();
  H264Link(H264Link &&) noexcept;
  H264Link &operator=(H264Link &&) noexcept;

  /// Replaces \p image by what arrives.
  void pass(vpImage<unsigned char> &image);
  /// Size of the last encoded picture.
  std::size_t lastBytes() const;

private:
  struct State;
  std::unique_ptr<State> m_state;
};
} // namespace bole
