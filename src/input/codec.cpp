// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/codec.h"
#include "geometry/failure.h"

#include <array>
#include <cstring>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libswscale/swscale.h>
}

namespace bole
{
namespace
{
constexpr int kLargestPicture_px = 16384 * 8192; // of a file; more is a damaged header
constexpr int kLargestLive_px = 2048 * 2048;     // of a drone

LibavPtr<AVCodecContext> allocateContext(const AVCodec *codec)
{
  LibavPtr<AVCodecContext> context(avcodec_alloc_context3(codec));
  if (!context)
    throw memoryAllocationError("no memory for a codec");
  context->thread_count = 1; // frame threads would delay by a frame each
  return context;
}
} // namespace

void FreeLibav::operator()(AVCodecContext *context) const { avcodec_free_context(&context); }
void FreeLibav::operator()(AVFrame *frame) const { av_frame_free(&frame); }
void FreeLibav::operator()(AVPacket *packet) const { av_packet_free(&packet); }
void FreeLibav::operator()(SwsContext *scaler) const { sws_freeContext(scaler); }

QuietLibav::QuietLibav() : m_level(av_log_get_level()) { av_log_set_level(AV_LOG_QUIET); }
QuietLibav::~QuietLibav() { av_log_set_level(m_level); }

void checkLibav(int code, const std::string &what)
{
  if (code >= 0)
    return;
  std::array<char, AV_ERROR_MAX_STRING_SIZE> reason{};
  av_strerror(code, reason.data(), reason.size());
  throw ioError("{}: {}", what, reason.data());
}

PictureDecoder::PictureDecoder(LibavPtr<AVCodecContext> context)
    : m_context(std::move(context)), m_frame(av_frame_alloc()), m_packet(av_packet_alloc())
{
  const QuietLibav quiet;
  m_context->log_level_offset = 64; // damage is reported by the caller
  checkLibav(avcodec_open2(m_context.get(), nullptr, nullptr), "the codec cannot be opened");
}

PictureDecoder::PictureDecoder(const AVCodecParameters &stream)
    : PictureDecoder([&stream] {
        const AVCodec *codec = avcodec_find_decoder(stream.codec_id);
        if (codec == nullptr)
          throw ioError("the codec is not known");
        LibavPtr<AVCodecContext> context = allocateContext(codec);
        avcodec_parameters_to_context(context.get(), &stream);
        context->err_recognition = AV_EF_CRCCHECK | AV_EF_BITSTREAM | AV_EF_BUFFER;
        context->max_pixels = kLargestPicture_px;
        return context;
      }())
{
}

PictureDecoder PictureDecoder::h264()
{
  const AVCodec *codec = avcodec_find_decoder(AV_CODEC_ID_H264);
  if (codec == nullptr)
    throw fatalError("libavcodec was built without an H.264 decoder");
  LibavPtr<AVCodecContext> context = allocateContext(codec);
  context->flags |= AV_CODEC_FLAG_LOW_DELAY;
  context->err_recognition = AV_EF_BITSTREAM | AV_EF_BUFFER | AV_EF_AGGRESSIVE | AV_EF_EXPLODE;
  context->max_pixels = kLargestLive_px;
  return PictureDecoder(std::move(context));
}

bool PictureDecoder::send(const AVPacket *packet) { return avcodec_send_packet(m_context.get(), packet) >= 0; }

bool PictureDecoder::send(const std::uint8_t *data, std::size_t size)
{
  if (av_new_packet(m_packet.get(), static_cast<int>(size)) < 0) // zeroes the padding behind the bytes
    return false;
  std::memcpy(m_packet->data, data, size);
  const bool is_taken = send(m_packet.get());
  av_packet_unref(m_packet.get());
  return is_taken;
}

const AVFrame *PictureDecoder::receive()
{
  const int code = avcodec_receive_frame(m_context.get(), m_frame.get());
  m_has_failed = code < 0 && code != AVERROR(EAGAIN) && code != AVERROR_EOF;
  return code < 0 ? nullptr : m_frame.get();
}

void PictureDecoder::flush() { avcodec_flush_buffers(m_context.get()); }

bool PictureDecoder::isDamaged(const AVFrame &picture)
{
  return picture.decode_error_flags != 0 || (picture.flags & AV_FRAME_FLAG_CORRUPT) != 0;
}

bool PictureDecoder::isYuv420(const AVFrame &picture)
{
  return picture.format == AV_PIX_FMT_YUV420P || picture.format == AV_PIX_FMT_YUVJ420P;
}
} // namespace bole
