// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/h264.h"

#include <algorithm>
#include <cmath>
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
  void operator()(AVCodecContext *context) const { avcodec_free_context(&context); }
};
struct FreeFrame
{
  void operator()(AVFrame *frame) const { av_frame_free(&frame); }
};
struct FreePacket
{
  void operator()(AVPacket *packet) const { av_packet_free(&packet); }
};
using Context = std::unique_ptr<AVCodecContext, FreeContext>;

void copyPlane(const std::uint8_t *from, int stride, int width, int height, std::vector<std::uint8_t> &to)
{
  to.resize(static_cast<std::size_t>(width) * height);
  for (int row = 0; row < height; ++row)
    std::copy_n(from + static_cast<std::ptrdiff_t>(row) * stride, width,
                to.begin() + static_cast<std::ptrdiff_t>(row) * width);
}

/// libavcodec writes to stderr about every damaged block; damage is counted and reported by us.
void silenceLibav()
{
  static const bool done = [] {
    av_log_set_level(AV_LOG_QUIET);
    return true;
  }();
  static_cast<void>(done);
}

std::uint8_t clampToByte(double value) { return static_cast<std::uint8_t>(std::clamp(value + 0.5, 0.0, 255.0)); }
} // namespace

void YuvPicture::toGrey(vpImage<unsigned char> &image) const
{
  image.resize(static_cast<unsigned>(height), static_cast<unsigned>(width));
  std::copy(y.begin(), y.end(), image.bitmap);
}

void YuvPicture::toColour(vpImage<vpRGBa> &image) const
{
  image.resize(static_cast<unsigned>(height), static_cast<unsigned>(width));
  const int half = (width + 1) / 2;
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const std::size_t at = static_cast<std::size_t>(v) * width + u;
      const std::size_t colour = static_cast<std::size_t>(v / 2) * half + u / 2;
      const double luma = y[at], blue = cb[colour] - 128.0, red = cr[colour] - 128.0;
      image.bitmap[at] = vpRGBa(clampToByte(luma + 1.402 * red), clampToByte(luma - 0.344136 * blue - 0.714136 * red),
                                clampToByte(luma + 1.772 * blue));
    }
}

struct H264Decoder::State
{
  Context context;
  std::unique_ptr<AVFrame, FreeFrame> frame{av_frame_alloc()};
  std::unique_ptr<AVPacket, FreePacket> packet{av_packet_alloc()};
  std::vector<std::uint8_t> padded;
};

H264Decoder::H264Decoder() : m_state(std::make_unique<State>())
{
  const AVCodec *codec = avcodec_find_decoder(AV_CODEC_ID_H264);
  if (codec == nullptr)
    throw vpException(vpException::fatalError, "libavcodec has no H.264 decoder");
  m_state->context.reset(avcodec_alloc_context3(codec));
  AVCodecContext &context = *m_state->context;
  context.flags |= AV_CODEC_FLAG_LOW_DELAY;
  context.thread_count = 1; // frame threads would delay by a frame each
  context.err_recognition = AV_EF_BITSTREAM | AV_EF_BUFFER | AV_EF_AGGRESSIVE | AV_EF_EXPLODE;
  context.max_pixels = 2048 * 2048;
  silenceLibav();
  if (avcodec_open2(&context, codec, nullptr) < 0)
    throw vpException(vpException::fatalError, "libavcodec could not open its H.264 decoder");
}

H264Decoder::~H264Decoder() = default;

void H264Decoder::flush() { avcodec_flush_buffers(m_state->context.get()); }

H264Decoder::Result H264Decoder::decode(const std::vector<std::uint8_t> &access_unit, int width, int height,
                                        YuvPicture &picture)
{
  m_message.clear();
  State &state = *m_state;
  state.padded.assign(access_unit.begin(), access_unit.end());
  state.padded.resize(access_unit.size() + AV_INPUT_BUFFER_PADDING_SIZE, 0);
  state.packet->data = state.padded.data();
  state.packet->size = static_cast<int>(access_unit.size());

  if (avcodec_send_packet(state.context.get(), state.packet.get()) < 0) {
    m_message = "the decoder refused the frame";
    return Result::damaged;
  }
  const int received = avcodec_receive_frame(state.context.get(), state.frame.get());
  if (received == AVERROR(EAGAIN))
    return Result::nothing;
  const AVFrame &frame = *state.frame;
  if (received < 0 || (frame.format != AV_PIX_FMT_YUV420P && frame.format != AV_PIX_FMT_YUVJ420P)) {
    m_message = received < 0 ? "the frame could not be decoded" : "the frame is not YCbCr 4:2:0";
    return Result::damaged;
  }
  picture.width = width > 0 ? std::min(width, frame.width) : frame.width;
  picture.height = height > 0 ? std::min(height, frame.height) : frame.height;
  copyPlane(frame.data[0], frame.linesize[0], picture.width, picture.height, picture.y);
  copyPlane(frame.data[1], frame.linesize[1], (picture.width + 1) / 2, (picture.height + 1) / 2, picture.cb);
  copyPlane(frame.data[2], frame.linesize[2], (picture.width + 1) / 2, (picture.height + 1) / 2, picture.cr);
  const bool damaged = frame.decode_error_flags != 0 || (frame.flags & AV_FRAME_FLAG_CORRUPT) != 0;
  av_frame_unref(state.frame.get());
  if (damaged) {
    m_message = "parts of the frame were concealed";
    return Result::damaged;
  }
  return Result::picture;
}

struct H264Encoder::State
{
  Context context;
  std::unique_ptr<AVFrame, FreeFrame> frame{av_frame_alloc()};
  std::unique_ptr<AVPacket, FreePacket> packet{av_packet_alloc()};
  int width = 0, height = 0;
};

H264Encoder::H264Encoder(int width, int height, double rate_hz, double bit_rate, int key_interval)
    : m_state(std::make_unique<State>())
{
  const AVCodec *codec = avcodec_find_encoder_by_name("libx264");
  if (codec == nullptr)
    codec = avcodec_find_encoder(AV_CODEC_ID_H264);
  if (codec == nullptr)
    throw vpException(vpException::fatalError,
                      "libavcodec was built without an H.264 encoder: the emulator of the AR.Drone 2 needs one");
  m_state->width = width;
  m_state->height = height;
  m_state->context.reset(avcodec_alloc_context3(codec));
  AVCodecContext &context = *m_state->context;
  context.width = codedWidth();
  context.height = codedHeight();
  context.pix_fmt = AV_PIX_FMT_YUV420P;
  context.time_base = AVRational{1, 1000};
  context.framerate = AVRational{static_cast<int>(std::lround(rate_hz * 1000)), 1000};
  context.bit_rate = static_cast<std::int64_t>(bit_rate);
  context.gop_size = key_interval;
  context.max_b_frames = 0;
  context.thread_count = 1;
  context.profile = FF_PROFILE_H264_BASELINE;
  av_opt_set(context.priv_data, "preset", "veryfast", 0);
  av_opt_set(context.priv_data, "tune", "zerolatency", 0);
  av_opt_set(context.priv_data, "profile", "baseline", 0);
  av_opt_set(context.priv_data, "x264-params",
             fmt::format("keyint={0}:min-keyint={0}:scenecut=0", key_interval).c_str(), 0);
  silenceLibav();
  if (avcodec_open2(&context, codec, nullptr) < 0)
    throw vpException(vpException::fatalError,
                      fmt::format("libavcodec could not open its H.264 encoder for {}x{} at {} Hz and {} bit/s", width,
                                  height, rate_hz, bit_rate));
  AVFrame &frame = *m_state->frame;
  frame.format = context.pix_fmt;
  frame.width = context.width;
  frame.height = context.height;
  if (av_frame_get_buffer(&frame, 0) < 0)
    throw vpException(vpException::fatalError, "no memory for the encoder's frame");
}

H264Encoder::~H264Encoder() = default;

int H264Encoder::codedWidth() const { return (m_state->width + 15) / 16 * 16; }
int H264Encoder::codedHeight() const { return (m_state->height + 15) / 16 * 16; }

namespace
{
/// Size in bytes, start code included, of the NAL unit at \p from; \p type is its type.
std::size_t nalSize(const std::vector<std::uint8_t> &bytes, std::size_t from, int &type)
{
  const auto startsAt = [&](std::size_t i) {
    return i + 3 < bytes.size() && bytes[i] == 0 && bytes[i + 1] == 0 &&
           (bytes[i + 2] == 1 || (bytes[i + 2] == 0 && bytes[i + 3] == 1));
  };
  if (!startsAt(from))
    return 0;
  const std::size_t payload = from + (bytes[from + 2] == 1 ? 3 : 4);
  if (payload >= bytes.size())
    return 0;
  type = bytes[payload] & 0x1f;
  std::size_t end = payload + 1;
  while (end < bytes.size() && !startsAt(end))
    ++end;
  return end - from;
}
} // namespace

H264Encoder::Packet H264Encoder::encode(const vpImage<unsigned char> &image, bool force_key)
{
  State &state = *m_state;
  if (static_cast<int>(image.getWidth()) != state.width || static_cast<int>(image.getHeight()) != state.height)
    throw vpException(vpException::dimensionError, "image size = %ux%u, must be %dx%d as the first", image.getWidth(),
                      image.getHeight(), state.width, state.height);
  AVFrame &frame = *state.frame;
  if (av_frame_make_writable(&frame) < 0)
    throw vpException(vpException::fatalError, "no memory for the encoder's frame");
  for (int v = 0; v < frame.height; ++v) {
    const unsigned char *row = image[static_cast<unsigned>(std::min(v, state.height - 1))];
    std::uint8_t *out = frame.data[0] + static_cast<std::ptrdiff_t>(v) * frame.linesize[0];
    std::copy_n(row, state.width, out);
    std::fill(out + state.width, out + frame.width, row[state.width - 1]);
  }
  for (int plane = 1; plane < 3; ++plane)
    std::fill_n(frame.data[plane], static_cast<std::ptrdiff_t>(frame.linesize[plane]) * frame.height / 2,
                std::uint8_t{128});
  frame.pict_type = force_key ? AV_PICTURE_TYPE_I : AV_PICTURE_TYPE_NONE;
  frame.pts += static_cast<std::int64_t>(1000.0 * state.context->framerate.den / state.context->framerate.num);

  Packet packet;
  if (avcodec_send_frame(state.context.get(), &frame) < 0 ||
      avcodec_receive_packet(state.context.get(), state.packet.get()) < 0)
    throw vpException(vpException::fatalError, "libavcodec did not encode the frame");
  packet.bytes.assign(state.packet->data, state.packet->data + state.packet->size);
  packet.is_key = (state.packet->flags & AV_PKT_FLAG_KEY) != 0;
  av_packet_unref(state.packet.get());
  int type = 0;
  const std::size_t first = packet.is_key ? nalSize(packet.bytes, 0, type) : 0;
  if (first > 0 && type == 7) {
    packet.sps_size = static_cast<std::uint8_t>(first);
    const std::size_t second = nalSize(packet.bytes, first, type);
    if (type == 8)
      packet.pps_size = static_cast<std::uint8_t>(second);
  }
  return packet;
}
} // namespace bole
