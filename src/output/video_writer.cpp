// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/video_writer.h"
#include "output/atomic_file.h"

#include <array>
#include <fmt/format.h>
#include <visp3/core/vpException.h>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>
}

namespace bole
{
namespace
{
constexpr AVRational kTimeBase{1, 90000};

void releaseFormat(AVFormatContext **format)
{
  if (*format != nullptr && (*format)->pb != nullptr)
    avio_closep(&(*format)->pb);
  avformat_free_context(*format);
}
void releaseScaler(SwsContext **scaler) { sws_freeContext(*scaler); }

template <typename Object, void (*release)(Object **)> struct Release
{
  void operator()(Object *object) const { release(&object); }
};

/// Keeps the encoder's report off the terminal.
class Quiet
{
public:
  Quiet() : m_level(av_log_get_level()) { av_log_set_level(AV_LOG_ERROR); }
  ~Quiet() { av_log_set_level(m_level); }
  Quiet(const Quiet &) = delete;
  Quiet &operator=(const Quiet &) = delete;

private:
  int m_level;
};
} // namespace

struct VideoWriter::Libav
{
  explicit Libav(const std::string &path) : file(path) {}

  void open(int width, int height, const std::string &name);
  void encode(const AVFrame *picture);
  void check(int code, const char *what) const
  {
    if (code >= 0)
      return;
    std::array<char, AV_ERROR_MAX_STRING_SIZE> reason{};
    av_strerror(code, reason.data(), reason.size());
    throw vpException(vpException::ioError, fmt::format("{}: {}: {}", file.path(), what, reason.data()));
  }

  AtomicFile file; // outlives the objects below, which write to it
  std::unique_ptr<AVFormatContext, Release<AVFormatContext, releaseFormat>> format;
  std::unique_ptr<AVCodecContext, Release<AVCodecContext, avcodec_free_context>> codec;
  std::unique_ptr<AVFrame, Release<AVFrame, av_frame_free>> frame;
  std::unique_ptr<AVPacket, Release<AVPacket, av_packet_free>> packet;
  std::unique_ptr<SwsContext, Release<SwsContext, releaseScaler>> scaler;
  unsigned width = 0, height = 0;
  std::int64_t first_ns = 0, last_pts = -1;
  std::int64_t step = kTimeBase.den / 25; ///< between the last two pictures, how long the last one is shown
  std::size_t pictures = 0;
};

void VideoWriter::Libav::open(int w, int h, const std::string &name)
{
  AVFormatContext *context = nullptr;
  check(avformat_alloc_output_context2(&context, nullptr, "mp4", name.c_str()), "no mp4 writer");
  format.reset(context);
  const AVCodec *encoder = avcodec_find_encoder_by_name("libx264");
  if (encoder == nullptr)
    encoder = avcodec_find_encoder(AV_CODEC_ID_H264);
  if (encoder == nullptr)
    encoder = avcodec_find_encoder(AV_CODEC_ID_MPEG4);
  if (encoder == nullptr)
    throw vpException(vpException::ioError, fmt::format("{}: no video encoder in libavcodec", file.path()));

  codec.reset(avcodec_alloc_context3(encoder));
  codec->log_level_offset = 64; // the encoder would tell of every video it ends
  codec->width = w;
  codec->height = h;
  codec->time_base = kTimeBase;
  codec->pix_fmt = AV_PIX_FMT_YUV420P;
  codec->thread_count = 1;
  codec->gop_size = 50;
  codec->flags |= (context->oformat->flags & AVFMT_GLOBALHEADER) != 0 ? AV_CODEC_FLAG_GLOBAL_HEADER : 0;
  av_opt_set(codec->priv_data, "preset", "veryfast", 0);
  av_opt_set(codec->priv_data, "crf", "21", 0);
  check(avcodec_open2(codec.get(), encoder, nullptr), "the encoder cannot be opened");

  AVStream *stream = avformat_new_stream(context, nullptr);
  check(stream == nullptr ? AVERROR(ENOMEM) : 0, "no stream");
  check(avcodec_parameters_from_context(stream->codecpar, codec.get()), "no stream");
  stream->time_base = kTimeBase;
  check(avio_open(&context->pb, name.c_str(), AVIO_FLAG_WRITE), "cannot be written");
  AVDictionary *options = nullptr;
  av_dict_set(&options, "movflags", "+faststart", 0);
  const int code = avformat_write_header(context, &options);
  av_dict_free(&options);
  check(code, "cannot be written");

  frame.reset(av_frame_alloc());
  frame->format = AV_PIX_FMT_YUV420P;
  frame->width = w;
  frame->height = h;
  check(av_frame_get_buffer(frame.get(), 0), "no memory for a picture");
  packet.reset(av_packet_alloc());
  scaler.reset(sws_getContext(w, h, AV_PIX_FMT_RGBA, w, h, AV_PIX_FMT_YUV420P, SWS_POINT, nullptr, nullptr, nullptr));
  check(scaler ? 0 : AVERROR(EINVAL), "no conversion to YUV");
}

void VideoWriter::Libav::encode(const AVFrame *picture)
{
  check(avcodec_send_frame(codec.get(), picture), "a picture cannot be encoded");
  for (;;) {
    const int code = avcodec_receive_packet(codec.get(), packet.get());
    if (code == AVERROR(EAGAIN) || code == AVERROR_EOF)
      return;
    check(code, "a picture cannot be encoded");
    packet->duration = step; // of no duration, the last picture would end before it begins and never be shown
    av_packet_rescale_ts(packet.get(), kTimeBase, format->streams[0]->time_base);
    check(av_interleaved_write_frame(format.get(), packet.get()), "cannot be written");
  }
}

VideoWriter::VideoWriter(const std::string &path) : m_libav(std::make_unique<Libav>(path)) {}

VideoWriter::~VideoWriter() = default;

std::size_t VideoWriter::pictures() const { return m_libav->pictures; }

void VideoWriter::write(const vpImage<vpRGBa> &picture, std::int64_t stamp_ns)
{
  const Quiet quiet;
  Libav &libav = *m_libav;
  if (libav.pictures == 0) {
    libav.width = picture.getWidth();
    libav.height = picture.getHeight();
    libav.first_ns = stamp_ns;
    libav.open(static_cast<int>(libav.width) & ~1, static_cast<int>(libav.height) & ~1, libav.file.temporaryPath());
  }
  if (picture.getWidth() != libav.width || picture.getHeight() != libav.height)
    throw vpException(vpException::dimensionError,
                      fmt::format("{}: picture of {}x{} px, must be {}x{}", libav.file.path(), picture.getWidth(),
                                  picture.getHeight(), libav.width, libav.height));
  const std::int64_t pts = av_rescale_q(stamp_ns - libav.first_ns, {1, 1'000'000'000}, kTimeBase);
  if (pts <= libav.last_pts)
    return;
  libav.check(av_frame_make_writable(libav.frame.get()), "no memory for a picture");
  const auto *pixels = reinterpret_cast<const std::uint8_t *>(picture.bitmap);
  const int stride = static_cast<int>(4 * picture.getWidth());
  sws_scale(libav.scaler.get(), &pixels, &stride, 0, libav.frame->height, libav.frame->data, libav.frame->linesize);
  if (libav.last_pts >= 0)
    libav.step = pts - libav.last_pts;
  libav.frame->pts = pts;
  libav.last_pts = pts;
  libav.encode(libav.frame.get());
  ++libav.pictures;
}

void VideoWriter::finish()
{
  const Quiet quiet;
  Libav &libav = *m_libav;
  if (!libav.format)
    return;
  libav.encode(nullptr);
  libav.check(av_write_trailer(libav.format.get()), "cannot be completed");
  libav.check(avio_closep(&libav.format->pb), "cannot be completed");
  libav.format.reset();
  libav.file.commit();
}
} // namespace bole
