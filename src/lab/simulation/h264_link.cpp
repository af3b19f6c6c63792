// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/simulation/h264_link.h"

#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <visp3/core/vpException.h>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/opt.h>
}

namespace bole
{
namespace
{
struct FreeContext
{
  void operator()(AVCodecContext *p) const { avcodec_free_context(&p); }
};
struct FreeFrame
{
  void operator()(AVFrame *p) const { av_frame_free(&p); }
};
struct FreePacket
{
  void operator()(AVPacket *p) const { av_packet_free(&p); }
};

void check(int result, const char *what)
{
  if (result < 0) {
    char text[AV_ERROR_MAX_STRING_SIZE] = {};
    av_strerror(result, text, sizeof text);
    throw vpException(vpException::fatalError, fmt::format("H.264 {}: {}", what, text));
  }
}
} // namespace

struct H264Link::State
{
  std::unique_ptr<AVCodecContext, FreeContext> encoder, decoder;
  std::unique_ptr<AVFrame, FreeFrame> sent, received;
  std::unique_ptr<AVPacket, FreePacket> packet;
  std::int64_t count = 0;
  std::size_t bytes = 0;

  State(int width, int height, double rate_hz, double kbps);
  void openEncoder(int width, int height, double rate_hz, double kbps);
};

H264Link::State::State(int width, int height, double rate_hz, double kbps)
    : sent(av_frame_alloc()), received(av_frame_alloc()), packet(av_packet_alloc())
{
  openEncoder(width, height, rate_hz, kbps);
  const AVCodec *codec = avcodec_find_decoder(AV_CODEC_ID_H264);
  if (!codec) {
    throw vpException(vpException::fatalError, "this libavcodec has no H.264 decoder");
  }
  decoder.reset(avcodec_alloc_context3(codec));
  decoder->thread_count = 1;
  decoder->flags |= AV_CODEC_FLAG_LOW_DELAY;
  check(avcodec_open2(decoder.get(), codec, nullptr), "decoder");
  sent->format = AV_PIX_FMT_YUV420P;
  sent->width = width;
  sent->height = height;
  check(av_frame_get_buffer(sent.get(), 0), "frame");
}

void H264Link::State::openEncoder(int width, int height, double rate_hz, double kbps)
{
  const AVCodec *codec = avcodec_find_encoder_by_name("libx264");
  if (!codec) {
    throw vpException(vpException::fatalError, "this libavcodec has no H.264 encoder (libx264)");
  }
  encoder.reset(avcodec_alloc_context3(codec));
  encoder->width = width;
  encoder->height = height;
  encoder->pix_fmt = AV_PIX_FMT_YUV420P;
  encoder->time_base = {1000, static_cast<int>(std::lround(1000 * rate_hz))};
  encoder->framerate = {static_cast<int>(std::lround(1000 * rate_hz)), 1000};
  encoder->bit_rate = static_cast<std::int64_t>(1000 * kbps);
  encoder->rc_max_rate = encoder->bit_rate;
  encoder->rc_buffer_size = static_cast<int>(encoder->bit_rate); // one second
  encoder->gop_size = 30;
  encoder->max_b_frames = 0;
  encoder->thread_count = 1;
  av_opt_set(encoder->priv_data, "preset", "veryfast", 0);
  av_opt_set(encoder->priv_data, "tune", "zerolatency", 0);
  av_opt_set(encoder->priv_data, "profile", "baseline", 0);
  av_opt_set(encoder->priv_data, "x264-params", "log=-1:threads=1", 0);
  check(avcodec_open2(encoder.get(), codec, nullptr), "encoder");
}

H264Link::H264Link(int width, int height, double rate_hz, double kbps)
{
  if (width % 2 || height % 2 || width < 16 || height < 16) {
    throw vpException(vpException::badValue,
                      fmt::format("image size = {}x{}, must be even for H.264 and at least 16", width, height));
  }
  if (!(kbps >= 50 && kbps <= 20000)) {
    throw vpException(vpException::badValue, fmt::format("h264_kbps = {}, must be 50 to 20000", kbps));
  }
  m_state = std::make_unique<State>(width, height, rate_hz, kbps);
}

H264Link::~H264Link() = default;
H264Link::H264Link(H264Link &&) noexcept = default;
H264Link &H264Link::operator=(H264Link &&) noexcept = default;

std::size_t H264Link::lastBytes() const { return m_state->bytes; }

void H264Link::pass(vpImage<unsigned char> &image)
{
  State &s = *m_state;
  const unsigned width = static_cast<unsigned>(s.sent->width), height = static_cast<unsigned>(s.sent->height);
  if (image.getWidth() != width || image.getHeight() != height) {
    throw vpException(vpException::dimensionError, fmt::format("image size = {}x{}, must be {}x{}", image.getWidth(),
                                                               image.getHeight(), width, height));
  }
  check(av_frame_make_writable(s.sent.get()), "frame");
  for (unsigned row = 0; row < height; ++row) {
    std::memcpy(s.sent->data[0] + row * s.sent->linesize[0], image[row], width);
  }
  for (int plane = 1; plane < 3; ++plane) {
    std::memset(s.sent->data[plane], 128, static_cast<std::size_t>(s.sent->linesize[plane]) * (height / 2));
  }
  s.sent->pts = s.count++;
  check(avcodec_send_frame(s.encoder.get(), s.sent.get()), "encoding");
  check(avcodec_receive_packet(s.encoder.get(), s.packet.get()), "encoding");
  s.bytes = static_cast<std::size_t>(s.packet->size);
  check(avcodec_send_packet(s.decoder.get(), s.packet.get()), "decoding");
  av_packet_unref(s.packet.get());
  check(avcodec_receive_frame(s.decoder.get(), s.received.get()), "decoding");
  for (unsigned row = 0; row < height; ++row) {
    std::memcpy(image[row], s.received->data[0] + row * s.received->linesize[0], width);
  }
}
} // namespace bole
