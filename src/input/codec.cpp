// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/codec.h"
#include "geometry/failure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/pixdesc.h>
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

namespace
{
constexpr int kRed = 9798, kGreen = 19235, kBlue = 3735, kGreyBits = 15; // BT.601 in 2^-15

AVCodecID codecOf(const std::vector<unsigned char> &bytes)
{
  if (bytes.size() < 4)
    return AV_CODEC_ID_NONE;
  const auto starts = [&bytes](unsigned char a, unsigned char b) { return bytes[0] == a && bytes[1] == b; };
  if (starts(0x89, 'P'))
    return AV_CODEC_ID_PNG;
  if (starts(0xFF, 0xD8))
    return AV_CODEC_ID_MJPEG;
  if (starts('B', 'M'))
    return AV_CODEC_ID_BMP;
  if (starts('I', 'I') || starts('M', 'M'))
    return AV_CODEC_ID_TIFF;
  if (bytes[0] != 'P')
    return AV_CODEC_ID_NONE;
  switch (bytes[1]) {
  case '1':
  case '4':
    return AV_CODEC_ID_PBM;
  case '2':
  case '5':
    return AV_CODEC_ID_PGM;
  case '3':
  case '6':
    return AV_CODEC_ID_PPM;
  default:
    return AV_CODEC_ID_NONE;
  }
}

/// One component of a row, brought to 8 bits.
void readComponent(const AVFrame &picture, const AVPixFmtDescriptor &format, int row, int component,
                   std::vector<std::uint16_t> &values)
{
  const bool has_palette = (format.flags & AV_PIX_FMT_FLAG_PAL) != 0;
  std::array<const std::uint8_t *, 4> planes = {picture.data[0], picture.data[1], picture.data[2], picture.data[3]};
  av_read_image_line2(values.data(), planes.data(), picture.linesize, &format, 0, row, has_palette ? 0 : component,
                      picture.width, 0, sizeof values[0]);
  if (has_palette)
    for (std::uint16_t &value : values) {
      std::uint32_t argb;
      std::memcpy(&argb, picture.data[1] + std::size_t{4} * value, sizeof argb);
      value = static_cast<std::uint16_t>((argb >> (16 - 8 * component)) & 0xFF);
    }
  else if (const int depth = format.comp[component].depth; depth > 8)
    for (std::uint16_t &value : values)
      value = static_cast<std::uint16_t>(value >> (depth - 8));
  else if (depth < 8)
    for (std::uint16_t &value : values)
      value = static_cast<std::uint16_t>(value * 255 / ((1 << depth) - 1));
}

bool toGrey(const AVFrame &picture, vpImage<unsigned char> &grey)
{
  const auto pixel_format = static_cast<AVPixelFormat>(picture.format);
  const AVPixFmtDescriptor *format = av_pix_fmt_desc_get(pixel_format);
  if (format == nullptr || (format->flags & (AV_PIX_FMT_FLAG_FLOAT | AV_PIX_FMT_FLAG_HWACCEL)) != 0)
    return false;
  const bool is_coloured = (format->flags & (AV_PIX_FMT_FLAG_RGB | AV_PIX_FMT_FLAG_PAL)) != 0;
  const AVComponentDescriptor &first = format->comp[0];
  const auto width = static_cast<std::size_t>(picture.width);
  grey.resize(static_cast<unsigned>(picture.height), static_cast<unsigned>(picture.width));
  std::array<std::vector<std::uint16_t>, 3> colours;
  for (auto &values : colours)
    values.resize(width);
  for (int row = 0; row < picture.height; ++row) {
    unsigned char *out = grey[static_cast<unsigned>(row)];
    if (!is_coloured && first.depth == 8 && first.step == 1) { // grey, or the luma of a JPEG
      std::copy_n(picture.data[0] + std::ptrdiff_t{row} * picture.linesize[0], width, out);
      continue;
    }
    for (int component = 0; component < (is_coloured ? 3 : 1); ++component)
      readComponent(picture, *format, row, component, colours[static_cast<std::size_t>(component)]);
    const auto &[red, green, blue] = colours;
    for (std::size_t u = 0; u < width; ++u)
      out[u] = is_coloured
                   ? static_cast<unsigned char>((kRed * red[u] + kGreen * green[u] + kBlue * blue[u]) >> kGreyBits)
                   : static_cast<unsigned char>(red[u]);
    if (pixel_format == AV_PIX_FMT_MONOWHITE)
      std::transform(out, out + width, out,
                     [](unsigned char value) { return static_cast<unsigned char>(255 - value); });
  }
  return true;
}

/// \p quantiser: of JPEG, 1 is the best; 0 for a format without loss.
std::string encoded(AVCodecID id, AVPixelFormat format, int width, int height, int quantiser,
                    const std::function<void(AVFrame &)> &fill)
{
  const QuietLibav quiet;
  const AVCodec *codec = avcodec_find_encoder(id);
  const LibavPtr<AVCodecContext> context(avcodec_alloc_context3(codec));
  const LibavPtr<AVFrame> frame(av_frame_alloc());
  const LibavPtr<AVPacket> packet(av_packet_alloc());
  if (codec == nullptr || !context || !frame || !packet)
    throw fatalError("libavcodec was built without {}", avcodec_get_name(id));
  context->width = frame->width = width;
  context->height = frame->height = height;
  context->pix_fmt = format;
  context->color_range = frame->color_range = AVCOL_RANGE_JPEG;
  context->time_base = AVRational{1, 1};
  context->thread_count = 1;
  frame->format = format;
  if (quantiser > 0) {
    context->flags |= AV_CODEC_FLAG_QSCALE;
    context->global_quality = frame->quality = FF_QP2LAMBDA * quantiser;
  }
  checkLibav(avcodec_open2(context.get(), codec, nullptr), "a picture cannot be encoded");
  checkLibav(av_frame_get_buffer(frame.get(), 0), "no memory for a picture");
  fill(*frame);
  checkLibav(avcodec_send_frame(context.get(), frame.get()), "a picture cannot be encoded");
  checkLibav(avcodec_send_frame(context.get(), nullptr), "a picture cannot be encoded");
  checkLibav(avcodec_receive_packet(context.get(), packet.get()), "a picture cannot be encoded");
  return {reinterpret_cast<const char *>(packet->data), static_cast<std::size_t>(packet->size)};
}
} // namespace

bool decodeGrey(const std::vector<unsigned char> &bytes, vpImage<unsigned char> &grey)
{
  const AVCodec *codec = avcodec_find_decoder(codecOf(bytes));
  if (codec == nullptr)
    return false;
  const LibavPtr<AVCodecContext> context(avcodec_alloc_context3(codec));
  const LibavPtr<AVFrame> frame(av_frame_alloc());
  const LibavPtr<AVPacket> packet(av_packet_alloc());
  if (!context || !frame || !packet || av_new_packet(packet.get(), static_cast<int>(bytes.size())) < 0)
    return false;
  context->thread_count = 1;
  context->log_level_offset = 64;                      // damage is reported by the caller
  context->idct_algo = FF_IDCT_INT;                    // the exact one: that of the Independent JPEG Group
  std::copy(bytes.begin(), bytes.end(), packet->data); // zeroes stand behind it
  return avcodec_open2(context.get(), codec, nullptr) >= 0 && avcodec_send_packet(context.get(), packet.get()) >= 0 &&
         (avcodec_send_packet(context.get(), nullptr), avcodec_receive_frame(context.get(), frame.get()) >= 0) &&
         toGrey(*frame, grey);
}

std::string encodePng(const vpImage<unsigned char> &grey)
{
  const auto width = static_cast<int>(grey.getWidth()), height = static_cast<int>(grey.getHeight());
  return encoded(AV_CODEC_ID_PNG, AV_PIX_FMT_GRAY8, width, height, 0, [&](AVFrame &frame) {
    for (int row = 0; row < height; ++row)
      std::copy_n(grey[static_cast<unsigned>(row)], width, frame.data[0] + std::ptrdiff_t{row} * frame.linesize[0]);
  });
}

std::string encodeJpeg(const vpImage<vpRGBa> &picture)
{
  constexpr int kQuantiser = 3; // a third of the size of a PNG, and nobody sees a difference
  const auto width = static_cast<int>(picture.getWidth()), height = static_cast<int>(picture.getHeight());
  return encoded(AV_CODEC_ID_MJPEG, AV_PIX_FMT_YUV444P, width, height, kQuantiser, [&](AVFrame &frame) {
    const auto level = [](double value) { return static_cast<std::uint8_t>(std::clamp(std::lround(value), 0L, 255L)); };
    for (int row = 0; row < height; ++row)
      for (int column = 0; column < width; ++column) {
        const vpRGBa &pixel = picture[static_cast<unsigned>(row)][column];
        const double luma = 0.299 * pixel.R + 0.587 * pixel.G + 0.114 * pixel.B;
        const auto at = [&](int plane) {
          return frame.data[plane] + std::ptrdiff_t{row} * frame.linesize[plane] + column;
        };
        *at(0) = level(luma);
        *at(1) = level(128 + (pixel.B - luma) / 1.772);
        *at(2) = level(128 + (pixel.R - luma) / 1.402);
      }
  });
}
} // namespace bole
