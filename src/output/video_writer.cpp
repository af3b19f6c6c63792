// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/video_writer.h"
#include "geometry/failure.h"
#include "input/atomic_file.h"
#include "input/codec.h"

#include <fmt/format.h>

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

struct CloseFormat
{
  void operator()(AVFormatContext *format) const
  {
    if (format->pb != nullptr)
      avio_closep(&format->pb);
    avformat_free_context(format);
  }
};
} // namespace

struct VideoWriter::Libav
{
  explicit Libav(const std::string &path) : file(path) {}

  void open(int width, int height, const std::string &name);
  void openEncoder(int width, int height);
  void encode(const AVFrame *picture);
  void check(int code, const char *what) const { checkLibav(code, fmt::format("{}: {}", file.path(), what)); }

  AtomicFile file; // outlives the objects below, which write to it
  std::unique_ptr<AVFormatContext, CloseFormat> format;
  LibavPtr<AVCodecContext> encoder;
  LibavPtr<AVFrame> frame{av_frame_alloc()};
  LibavPtr<AVPacket> packet{av_packet_alloc()};
  LibavPtr<SwsContext> scaler;
  unsigned width = 0, height = 0;
  std::int64_t first_ns = 0, last_pts = -1;
  std::int64_t step = kTimeBase.den / 25; ///< between the last two pictures, how long the last one is shown
  std::size_t pictures = 0;
};

/// Opens an encoder of H.264 in constant quality, or of MPEG-4 where libavcodec has none of H.264.
void VideoWriter::Libav::openEncoder(int w, int h)
{
  constexpr int kKeyInterval = 50; // pictures from a key frame to the next
  const AVCodec *codec = avcodec_find_encoder_by_name("libx264");
  for (const AVCodecID other : {AV_CODEC_ID_H264, AV_CODEC_ID_MPEG4})
    codec = codec == nullptr ? avcodec_find_encoder(other) : codec;
  if (codec == nullptr)
    throw ioError("{}: libavcodec was built without an H.264 encoder", file.path());
  encoder.reset(avcodec_alloc_context3(codec));
  check(encoder ? 0 : AVERROR(ENOMEM), "no memory for a codec");
  encoder->thread_count = 1; // frame threads would delay by a frame each
  encoder->width = w;
  encoder->height = h;
  encoder->pix_fmt = AV_PIX_FMT_YUV420P;
  encoder->time_base = kTimeBase;
  encoder->gop_size = kKeyInterval;
  encoder->log_level_offset = 64; // the encoder would tell of every video it ends
  if ((format->oformat->flags & AVFMT_GLOBALHEADER) != 0)
    encoder->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  av_opt_set(encoder->priv_data, "preset", "veryfast", 0);
  av_opt_set(encoder->priv_data, "crf", "21", 0); // x264's quality: lower is better
  check(avcodec_open2(encoder.get(), codec, nullptr),
        fmt::format("the H.264 encoder cannot be opened for {}x{} px", w, h).c_str());
  frame->format = encoder->pix_fmt;
  frame->width = w;
  frame->height = h;
  check(av_frame_get_buffer(frame.get(), 0), "no memory for a picture");
}

void VideoWriter::Libav::open(int w, int h, const std::string &name)
{
  AVFormatContext *context = nullptr;
  check(avformat_alloc_output_context2(&context, nullptr, "mp4", name.c_str()), "no mp4 writer");
  format.reset(context);
  openEncoder(w, h);
  AVStream *stream = avformat_new_stream(context, nullptr);
  check(stream == nullptr ? AVERROR(ENOMEM) : 0, "no stream");
  check(avcodec_parameters_from_context(stream->codecpar, encoder.get()), "no stream");
  stream->time_base = kTimeBase;
  check(avio_open(&context->pb, name.c_str(), AVIO_FLAG_WRITE), "cannot be written");
  AVDictionary *options = nullptr;
  av_dict_set(&options, "movflags", "+faststart", 0);
  const int code = avformat_write_header(context, &options);
  av_dict_free(&options);
  check(code, "cannot be written");

  scaler.reset(sws_getContext(w, h, AV_PIX_FMT_RGBA, w, h, AV_PIX_FMT_YUV420P, SWS_POINT, nullptr, nullptr, nullptr));
  check(scaler ? 0 : AVERROR(EINVAL), "no conversion to YUV");
}

/// Encodes \p picture and writes the packets that come out; a null pointer ends the video.
void VideoWriter::Libav::encode(const AVFrame *picture)
{
  checkLibav(avcodec_send_frame(encoder.get(), picture), "a picture cannot be encoded");
  for (;;) {
    const int code = avcodec_receive_packet(encoder.get(), packet.get());
    if (code == AVERROR(EAGAIN) || code == AVERROR_EOF)
      return;
    checkLibav(code, "a picture cannot be encoded");
    packet->duration = step; // a last picture without a duration would never be shown
    av_packet_rescale_ts(packet.get(), kTimeBase, format->streams[0]->time_base);
    check(av_interleaved_write_frame(format.get(), packet.get()), "cannot be written");
    av_packet_unref(packet.get());
  }
}

VideoWriter::VideoWriter(const std::string &path) : m_libav(std::make_unique<Libav>(path)) {}

VideoWriter::~VideoWriter() = default;

std::size_t VideoWriter::pictures() const { return m_libav->pictures; }

void VideoWriter::write(const vpImage<vpRGBa> &picture, std::int64_t stamp_ns)
{
  const QuietLibav quiet;
  Libav &libav = *m_libav;
  if (libav.pictures == 0) {
    libav.width = picture.getWidth();
    libav.height = picture.getHeight();
    libav.first_ns = stamp_ns;
    libav.open(static_cast<int>(libav.width) & ~1, static_cast<int>(libav.height) & ~1,
               "file:" + libav.file.temporaryPath()); // a colon in a name is no protocol
  }
  if (picture.getWidth() != libav.width || picture.getHeight() != libav.height)
    throw dimensionError("{}: picture of {}x{} px, must be {}x{}", libav.file.path(), picture.getWidth(),
                         picture.getHeight(), libav.width, libav.height);
  const std::int64_t pts = av_rescale_q(stamp_ns - libav.first_ns, {1, 1'000'000'000}, kTimeBase);
  if (pts <= libav.last_pts)
    return;
  AVFrame &frame = *libav.frame;
  checkLibav(av_frame_make_writable(&frame), "no memory for a picture");
  const auto *pixels = reinterpret_cast<const std::uint8_t *>(picture.bitmap);
  const int stride = static_cast<int>(4 * picture.getWidth());
  sws_scale(libav.scaler.get(), &pixels, &stride, 0, frame.height, frame.data, frame.linesize);
  if (libav.last_pts >= 0)
    libav.step = pts - libav.last_pts;
  libav.last_pts = pts;
  frame.pts = pts;
  libav.encode(&frame);
  ++libav.pictures;
}

void VideoWriter::finish()
{
  const QuietLibav quiet;
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
