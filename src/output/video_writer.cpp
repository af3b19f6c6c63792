// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/video_writer.h"
#include "geometry/failure.h"
#include "input/atomic_file.h"
#include "input/codec.h"

#include <fmt/format.h>
#include <optional>
#include <visp3/core/vpException.h>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
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
  void write(AVPacket &packet);
  void check(int code, const char *what) const { checkLibav(code, fmt::format("{}: {}", file.path(), what)); }

  AtomicFile file; // outlives the objects below, which write to it
  std::unique_ptr<AVFormatContext, CloseFormat> format;
  std::optional<PictureEncoder> encoder;
  LibavPtr<SwsContext> scaler;
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
  PictureEncoder::Settings settings;
  settings.width = w;
  settings.height = h;
  settings.ticks_per_second = kTimeBase.den;
  settings.may_be_mpeg4 = true;
  settings.has_global_header = (context->oformat->flags & AVFMT_GLOBALHEADER) != 0;
  try {
    encoder.emplace(settings);
  }
  catch (const vpException &error) {
    throw ioError("{}: {}", file.path(), error.getStringMessage());
  }

  AVStream *stream = avformat_new_stream(context, nullptr);
  check(stream == nullptr ? AVERROR(ENOMEM) : 0, "no stream");
  check(avcodec_parameters_from_context(stream->codecpar, &encoder->context()), "no stream");
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

void VideoWriter::Libav::write(AVPacket &packet)
{
  packet.duration = step; // of no duration, the last picture would end before it begins and never be shown
  av_packet_rescale_ts(&packet, kTimeBase, format->streams[0]->time_base);
  check(av_interleaved_write_frame(format.get(), &packet), "cannot be written");
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
  AVFrame &frame = libav.encoder->picture();
  const auto *pixels = reinterpret_cast<const std::uint8_t *>(picture.bitmap);
  const int stride = static_cast<int>(4 * picture.getWidth());
  sws_scale(libav.scaler.get(), &pixels, &stride, 0, frame.height, frame.data, frame.linesize);
  if (libav.last_pts >= 0)
    libav.step = pts - libav.last_pts;
  libav.last_pts = pts;
  libav.encoder->encode(pts, [&libav](AVPacket &packet) { libav.write(packet); });
  ++libav.pictures;
}

void VideoWriter::finish()
{
  const QuietLibav quiet;
  Libav &libav = *m_libav;
  if (!libav.format)
    return;
  libav.encoder->finish([&libav](AVPacket &packet) { libav.write(packet); });
  libav.check(av_write_trailer(libav.format.get()), "cannot be completed");
  libav.check(avio_closep(&libav.format->pb), "cannot be completed");
  libav.format.reset();
  libav.file.commit();
}
} // namespace bole
