// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What differs between the versions of FFmpeg's libraries (5 to 9), in one place.

#include <cstdint>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
}

namespace bole::libav
{
#ifdef AV_PROFILE_H264_BASELINE // since 6.1; the other name is gone since 9
constexpr int kBaseline = AV_PROFILE_H264_BASELINE;
#else
constexpr int kBaseline = FF_PROFILE_H264_BASELINE;
#endif

/// The matrix that brings the pictures of \p stream upright, as av_display_rotation_get() takes it; nullptr for none.
inline const std::uint8_t *displayMatrix(const AVStream &stream)
{
#if LIBAVCODEC_VERSION_INT >= AV_VERSION_INT(60, 31, 100)
  const AVPacketSideData *data = av_packet_side_data_get(
      stream.codecpar->coded_side_data, stream.codecpar->nb_coded_side_data, AV_PKT_DATA_DISPLAYMATRIX);
  return data == nullptr ? nullptr : data->data;
#else
  return av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, nullptr);
#endif
}
} // namespace bole::libav
