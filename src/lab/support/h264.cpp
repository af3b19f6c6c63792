// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/h264.h"

#include "support/text.h"

#include <algorithm>
#include <cmath>
#include <cstring>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/opt.h>
}

namespace bole
{
namespace h264
{
constexpr int kTicks = 1'000'000; // a second

struct Free
{
  void operator()(AVCodecContext *context) const { avcodec_free_context(&context); }
  void operator()(AVFrame *frame) const { av_frame_free(&frame); }
  void operator()(AVPacket *packet) const { av_packet_free(&packet); }
};

void check(int code, const char *what)
{
  if (code < 0)
    throw ioError("H.264: {}", what);
}

/// A codec with the picture and the packet that go through it.
struct Codec
{
  std::unique_ptr<AVCodecContext, Free> context;
  std::unique_ptr<AVFrame, Free> frame;
  std::unique_ptr<AVPacket, Free> packet;

  explicit Codec(const AVCodec *codec) : frame(av_frame_alloc()), packet(av_packet_alloc())
  {
    if (codec == nullptr)
      throw ioError("libavcodec was built without an H.264 codec");
    context.reset(avcodec_alloc_context3(codec));
    context->thread_count = 1;      // frame threads would delay by a frame each
    context->log_level_offset = 64; // what goes wrong is told by exceptions
  }
  void open() const { check(avcodec_open2(context.get(), nullptr, nullptr), "the codec cannot be opened"); }
};

const AVCodec *encoder()
{
  const AVCodec *codec = avcodec_find_encoder_by_name("libx264");
  return codec != nullptr ? codec : avcodec_find_encoder(AV_CODEC_ID_H264);
}
} // namespace h264
using namespace h264;

struct VideoPacketEncoder::Libav : Codec
{
  double rate_hz;
  std::int64_t count = 0;

  explicit Libav(const Settings &settings) : Codec(encoder()), rate_hz(settings.rate_hz)
  {
    context->width = settings.width;
    context->height = settings.height;
    context->pix_fmt = AV_PIX_FMT_YUV420P;
    context->time_base = AVRational{1, kTicks};
    context->framerate = AVRational{static_cast<int>(std::lround(settings.rate_hz * 1000)), 1000};
    context->gop_size = settings.key_interval;
    context->bit_rate = static_cast<std::int64_t>(settings.bit_rate);
    if (settings.is_bit_rate_limited) {
      context->rc_max_rate = context->bit_rate;
      context->rc_buffer_size = static_cast<int>(context->bit_rate); // one second
    }
    context->max_b_frames = 0;
    av_opt_set(context->priv_data, "preset", "veryfast", 0);
    av_opt_set(context->priv_data, "tune", "zerolatency", 0);
    av_opt_set(context->priv_data, "profile", "baseline", 0);
    if (!settings.x264_parameters.empty())
      av_opt_set(context->priv_data, "x264-params", settings.x264_parameters.c_str(), 0);
    open();
    frame->format = context->pix_fmt;
    frame->width = context->width;
    frame->height = context->height;
    check(av_frame_get_buffer(frame.get(), 0), "no memory for a picture");
  }

  void fill(const vpImage<unsigned char> &image) const
  {
    check(av_frame_make_writable(frame.get()), "no memory for a picture");
    const int width = std::min(static_cast<int>(image.getWidth()), frame->width);
    const int last_row = static_cast<int>(image.getHeight()) - 1;
    for (int v = 0; v < frame->height; ++v) {
      const unsigned char *row = image[static_cast<unsigned>(std::min(v, last_row))];
      std::uint8_t *out = frame->data[0] + static_cast<std::ptrdiff_t>(v) * frame->linesize[0];
      std::copy_n(row, width, out);
      std::fill(out + width, out + frame->width, row[width - 1]);
    }
    for (int plane = 1; plane < 3; ++plane)
      std::fill_n(frame->data[plane], static_cast<std::ptrdiff_t>(frame->linesize[plane]) * (frame->height / 2),
                  std::uint8_t{128});
  }
};

VideoPacketEncoder::VideoPacketEncoder(const Settings &settings) : m_libav(std::make_unique<Libav>(settings)) {}
VideoPacketEncoder::~VideoPacketEncoder() = default;
int VideoPacketEncoder::width() const { return m_libav->context->width; }
int VideoPacketEncoder::height() const { return m_libav->context->height; }

VideoPacketEncoder::Packet VideoPacketEncoder::encode(const vpImage<unsigned char> &image, bool is_key_forced)
{
  Libav &libav = *m_libav;
  libav.fill(image);
  libav.frame->pict_type = is_key_forced ? AV_PICTURE_TYPE_I : AV_PICTURE_TYPE_NONE;
  libav.frame->pts = std::llround(kTicks * static_cast<double>(libav.count++) / libav.rate_hz);
  check(avcodec_send_frame(libav.context.get(), libav.frame.get()), "a picture cannot be encoded");
  check(avcodec_receive_packet(libav.context.get(), libav.packet.get()), "a picture was not encoded at once");
  Packet packet{{libav.packet->data, libav.packet->data + libav.packet->size},
                (libav.packet->flags & AV_PKT_FLAG_KEY) != 0};
  av_packet_unref(libav.packet.get());
  return packet;
}

struct VideoPacketDecoder::Libav : Codec
{
  Libav() : Codec(avcodec_find_decoder(AV_CODEC_ID_H264))
  {
    context->flags |= AV_CODEC_FLAG_LOW_DELAY;
    open();
  }
};

VideoPacketDecoder::VideoPacketDecoder() : m_libav(std::make_unique<Libav>()) {}
VideoPacketDecoder::~VideoPacketDecoder() = default;

void VideoPacketDecoder::decode(const VideoPacketEncoder::Packet &packet, vpImage<unsigned char> &image)
{
  Libav &libav = *m_libav;
  check(av_new_packet(libav.packet.get(), static_cast<int>(packet.bytes.size())), "no memory for a packet");
  std::memcpy(libav.packet->data, packet.bytes.data(), packet.bytes.size());
  const int sent = avcodec_send_packet(libav.context.get(), libav.packet.get());
  av_packet_unref(libav.packet.get());
  check(sent, "a packet cannot be decoded");
  check(avcodec_receive_frame(libav.context.get(), libav.frame.get()), "no picture arrived");
  for (unsigned row = 0; row < image.getHeight(); ++row)
    std::memcpy(image[row], libav.frame->data[0] + static_cast<std::ptrdiff_t>(row) * libav.frame->linesize[0],
                image.getWidth());
}

namespace
{
VideoPacketEncoder::Settings settingsOf(int width, int height, double rate_hz, double kbps)
{
  if (width % 2 || height % 2 || width < 16 || height < 16)
    throw badValue("image size = {}x{}, must be even for H.264 and at least 16", width, height);
  if (!(kbps >= 50 && kbps <= 20000))
    throw badValue("h264_kbps = {}, must be 50 to 20000", kbps);
  return {width, height, rate_hz, 1000 * kbps, true, 30, "log=-1:threads=1"};
}
} // namespace

H264Link::H264Link(int width, int height, double rate_hz, double kbps)
    : m_encoder(settingsOf(width, height, rate_hz, kbps))
{
}

void H264Link::pass(vpImage<unsigned char> &image)
{
  const VideoPacketEncoder::Packet packet = m_encoder.encode(image);
  m_bytes = packet.bytes.size();
  m_decoder.decode(packet, image);
}
} // namespace bole
