// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/codec.h"
#include "geometry/failure.h"
#include "input/libav.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fmt/format.h>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/opt.h>
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

const AVCodec *findEncoder(const PictureEncoder::Settings &settings)
{
  const AVCodec *codec = avcodec_find_encoder_by_name("libx264");
  if (codec == nullptr)
    codec = avcodec_find_encoder(AV_CODEC_ID_H264);
  if (codec == nullptr && settings.may_be_mpeg4)
    codec = avcodec_find_encoder(AV_CODEC_ID_MPEG4);
  if (codec == nullptr)
    throw fatalError("libavcodec was built without an H.264 encoder");
  return codec;
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

PictureEncoder::PictureEncoder(const Settings &settings) : m_frame(av_frame_alloc()), m_packet(av_packet_alloc())
{
  const QuietLibav quiet;
  const AVCodec *codec = findEncoder(settings);
  m_context = allocateContext(codec);
  AVCodecContext &context = *m_context;
  context.width = settings.width;
  context.height = settings.height;
  context.pix_fmt = AV_PIX_FMT_YUV420P;
  context.time_base = AVRational{1, settings.ticks_per_second};
  context.gop_size = settings.key_interval;
  context.log_level_offset = 64; // the encoder would tell of every video it ends
  if (settings.rate_hz > 0)
    context.framerate = AVRational{static_cast<int>(std::lround(settings.rate_hz * 1000)), 1000};
  if (settings.bit_rate > 0)
    context.bit_rate = static_cast<std::int64_t>(settings.bit_rate);
  if (settings.is_bit_rate_limited) {
    context.rc_max_rate = context.bit_rate;
    context.rc_buffer_size = static_cast<int>(context.bit_rate); // one second
  }
  if (settings.has_global_header)
    context.flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  av_opt_set(context.priv_data, "preset", "veryfast", 0);
  if (settings.bit_rate <= 0)
    av_opt_set(context.priv_data, "crf", std::to_string(settings.quality).c_str(), 0);
  if (settings.is_live) {
    context.max_b_frames = 0;
    context.profile = libav::kBaseline;
    av_opt_set(context.priv_data, "tune", "zerolatency", 0);
    av_opt_set(context.priv_data, "profile", "baseline", 0);
  }
  if (!settings.x264_parameters.empty())
    av_opt_set(context.priv_data, "x264-params", settings.x264_parameters.c_str(), 0);
  checkLibav(avcodec_open2(&context, codec, nullptr),
             fmt::format("the H.264 encoder cannot be opened for {}x{} px", settings.width, settings.height));
  m_frame->format = context.pix_fmt;
  m_frame->width = context.width;
  m_frame->height = context.height;
  checkLibav(av_frame_get_buffer(m_frame.get(), 0), "no memory for a picture");
}

AVFrame &PictureEncoder::picture()
{
  checkLibav(av_frame_make_writable(m_frame.get()), "no memory for a picture");
  return *m_frame;
}

void PictureEncoder::fill(const vpImage<unsigned char> &image)
{
  AVFrame &frame = picture();
  const int width = std::min(static_cast<int>(image.getWidth()), frame.width);
  const int last_row = static_cast<int>(image.getHeight()) - 1;
  for (int v = 0; v < frame.height; ++v) {
    const unsigned char *row = image[static_cast<unsigned>(std::min(v, last_row))];
    std::uint8_t *out = frame.data[0] + static_cast<std::ptrdiff_t>(v) * frame.linesize[0];
    std::copy_n(row, width, out);
    std::fill(out + width, out + frame.width, row[width - 1]);
  }
  for (int plane = 1; plane < 3; ++plane)
    std::fill_n(frame.data[plane], static_cast<std::ptrdiff_t>(frame.linesize[plane]) * (frame.height / 2),
                std::uint8_t{128});
}

void PictureEncoder::encode(std::int64_t stamp, const Sink &sink, bool is_key_forced)
{
  m_frame->pict_type = is_key_forced ? AV_PICTURE_TYPE_I : AV_PICTURE_TYPE_NONE;
  m_frame->pts = stamp;
  send(m_frame.get(), sink);
}

void PictureEncoder::finish(const Sink &sink) { send(nullptr, sink); }

void PictureEncoder::send(const AVFrame *frame, const Sink &sink)
{
  const QuietLibav quiet;
  checkLibav(avcodec_send_frame(m_context.get(), frame), "a picture cannot be encoded");
  for (;;) {
    const int code = avcodec_receive_packet(m_context.get(), m_packet.get());
    if (code == AVERROR(EAGAIN) || code == AVERROR_EOF)
      return;
    checkLibav(code, "a picture cannot be encoded");
    sink(*m_packet);
    av_packet_unref(m_packet.get());
  }
}
} // namespace bole
