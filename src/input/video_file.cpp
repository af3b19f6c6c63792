// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/video_file.h"
#include "geometry/failure.h"
#include "input/codec.h"
#include "input/regular_file.h"
#include "input/steady_clock.h"
#include "input/user_text.h"

#include <array>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>
#include <visp3/core/vpException.h>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/pixdesc.h>
#include <libswscale/swscale.h>
}

namespace bole
{
namespace
{
struct CloseFormat
{
  void operator()(AVFormatContext *format) const { avformat_close_input(&format); }
};

/// The matrix that brings the pictures of \p stream upright, as av_display_rotation_get() takes it; nullptr for none.
const std::uint8_t *displayMatrix(const AVStream &stream)
{
#if LIBAVCODEC_VERSION_INT >= AV_VERSION_INT(60, 31, 100)
  const AVPacketSideData *data = av_packet_side_data_get(
      stream.codecpar->coded_side_data, stream.codecpar->nb_coded_side_data, AV_PKT_DATA_DISPLAYMATRIX);
  return data == nullptr ? nullptr : data->data;
#else
  return av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, nullptr);
#endif
}

/// Quarter turns, clockwise, that bring the picture upright.
int quarterTurns(AVStream &stream)
{
  const std::uint8_t *matrix = displayMatrix(stream);
  if (matrix == nullptr)
    return 0;
  std::array<std::int32_t, 9> values;
  std::memcpy(values.data(), matrix, sizeof values);
  const double degrees = -av_display_rotation_get(values.data());
  return std::isfinite(degrees) ? (static_cast<int>(std::lround(degrees / 90)) % 4 + 4) % 4 : 0;
}

/// Whether the first plane is the 8-bit luma of every pixel.
bool hasLumaPlane(AVPixelFormat format)
{
  switch (format) {
  case AV_PIX_FMT_YUV420P:
  case AV_PIX_FMT_YUV422P:
  case AV_PIX_FMT_YUV444P:
  case AV_PIX_FMT_YUVJ420P:
  case AV_PIX_FMT_YUVJ422P:
  case AV_PIX_FMT_YUVJ444P:
  case AV_PIX_FMT_NV12:
  case AV_PIX_FMT_GRAY8:
    return true;
  default:
    return false;
  }
}

bool isFullRange(const AVFrame &frame)
{
  const auto format = static_cast<AVPixelFormat>(frame.format);
  return frame.color_range == AVCOL_RANGE_JPEG || format == AV_PIX_FMT_YUVJ420P || format == AV_PIX_FMT_YUVJ422P ||
         format == AV_PIX_FMT_YUVJ444P || format == AV_PIX_FMT_GRAY8;
}

/// Luma 16 .. 235 of video to 0 .. 255.
const std::array<unsigned char, 256> &fullRangeTable()
{
  static const auto kTable = [] {
    std::array<unsigned char, 256> table{};
    for (int i = 0; i < 256; ++i)
      table[static_cast<std::size_t>(i)] = cv::saturate_cast<unsigned char>((i - 16) * 255.0 / 219.0);
    return table;
  }();
  return kTable;
}
} // namespace

struct VideoFile::Libav
{
  std::unique_ptr<AVFormatContext, CloseFormat> format;
  std::optional<PictureDecoder> decoder;
  LibavPtr<AVPacket> packet{av_packet_alloc()};
  LibavPtr<SwsContext> scaler;
  int stream = 0;
  int quarter_turns = 0;

  cv::Mat grey(const AVFrame &picture);
};

cv::Mat VideoFile::Libav::grey(const AVFrame &picture)
{
  const auto pixel_format = static_cast<AVPixelFormat>(picture.format);
  cv::Mat image(picture.height, picture.width, CV_8UC1);
  if (hasLumaPlane(pixel_format)) {
    const bool is_full = isFullRange(picture);
    const auto &table = fullRangeTable();
    for (int v = 0; v < picture.height; ++v) {
      const unsigned char *line = picture.data[0] + static_cast<std::ptrdiff_t>(v) * picture.linesize[0];
      unsigned char *out = image.ptr(v);
      for (int u = 0; u < picture.width; ++u)
        out[u] = is_full ? line[u] : table[line[u]];
    }
  }
  else {
    scaler.reset(sws_getCachedContext(scaler.release(), picture.width, picture.height, pixel_format, picture.width,
                                      picture.height, AV_PIX_FMT_GRAY8, SWS_POINT, nullptr, nullptr, nullptr));
    if (!scaler)
      return {};
    unsigned char *out[] = {image.data};
    const int stride[] = {static_cast<int>(image.step)};
    sws_scale(scaler.get(), picture.data, picture.linesize, 0, picture.height, out, stride);
  }
  if (quarter_turns != 0) {
    const int codes[] = {cv::ROTATE_90_CLOCKWISE, cv::ROTATE_180, cv::ROTATE_90_COUNTERCLOCKWISE};
    cv::rotate(image.clone(), image, codes[quarter_turns - 1]);
  }
  return image;
}

namespace
{
constexpr double kOpening_s = 10, kSilence_s = 3; ///< that an address may take to answer, and between two packets

/// Pictures one after the other as cameras push them: without stamps, and whatever length is said, without an end.
bool isMultipart(const AVFormatContext &format) { return std::strcmp(format.iformat->name, "mpjpeg") == 0; }

/// Asked by libav again and again while it waits.
int isOver(void *limit)
{
  const auto *of = static_cast<const ReadLimit *>(limit);
  return of->is_stopped || steadyNowNs() > of->until_ns ? 1 : 0;
}
/// Whether the file begins as an MP4 or a QuickTime does.
bool isMp4(const std::string &path)
{
  char head[8] = {};
  openRegularFile(path).read(head, sizeof head);
  return std::memcmp(head + 4, "ftyp", 4) == 0;
}
} // namespace

VideoFile::VideoFile(const std::string &path) : m_path(path), m_name(path), m_libav(std::make_unique<Libav>())
{
  openRegularFile(path);
  open("file:" + path); // else "12:30.mp4" is a protocol
}

VideoFile::VideoFile(const std::string &address, std::shared_ptr<ReadLimit> limit)
    : m_path(address), m_name(withoutSecrets(address)), m_limit(std::move(limit)), m_libav(std::make_unique<Libav>())
{
  open(address);
}

void VideoFile::allowReading(double seconds) const
{
  if (m_limit)
    m_limit->until_ns = steadyNowNs() + static_cast<std::int64_t>(seconds * 1e9);
}

void VideoFile::open(const std::string &url)
{
  const QuietLibav quiet;
  AVFormatContext *format = avformat_alloc_context();
  AVDictionary *options = nullptr;
  if (m_limit && format != nullptr) {
    format->interrupt_callback = {isOver, m_limit.get()};
    if (m_path.rfind("rtsp", 0) == 0)
      av_dict_set(&options, "rtsp_flags", "prefer_tcp", 0); // over UDP a lost packet is a broken picture
  }
  allowReading(kOpening_s);
  const int opened = avformat_open_input(&format, url.c_str(), nullptr, &options);
  av_dict_free(&options);
  const bool has_no_index = opened == AVERROR_INVALIDDATA && !m_limit && isMp4(m_path);
  checkLibav(opened,
             m_name + (has_no_index ? ": no video: its index is missing (moov), as of a recording that was cut off"
                                    : ": no video"));
  m_libav->format.reset(format);
  format->use_wallclock_as_timestamps = m_limit && isMultipart(*format) ? 1 : 0;
  checkLibav(avformat_find_stream_info(format, nullptr), m_name + ": no video");
  m_libav->stream = av_find_best_stream(format, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
  checkLibav(m_libav->stream, m_name + ": no video stream that can be decoded");

  AVStream &stream = *format->streams[m_libav->stream];
  try {
    m_libav->decoder.emplace(*stream.codecpar);
  }
  catch (const vpException &error) {
    throw ioError("{}: {}", m_name, error.getStringMessage());
  }
  m_libav->quarter_turns = quarterTurns(stream);
}

VideoFile::~VideoFile() = default;

std::size_t VideoFile::frames() const
{
  const std::int64_t count = m_libav->format->streams[m_libav->stream]->nb_frames;
  return count > 0 ? static_cast<std::size_t>(count) : 0;
}

std::int64_t VideoFile::duration_ns() const
{
  const AVFormatContext &format = *m_libav->format;
  const AVStream &stream = *format.streams[m_libav->stream];
  const AVRational nanoseconds{1, 1'000'000'000};
  if (stream.duration != AV_NOPTS_VALUE && stream.duration > 0)
    return av_rescale_q(stream.duration, stream.time_base, nanoseconds);
  return format.duration > 0 ? av_rescale_q(format.duration, {1, AV_TIME_BASE}, nanoseconds) : 0;
}

bool VideoFile::isLive() const
{
  const AVFormatContext &format = *m_libav->format;
  const bool has_length = !isMultipart(format) && format.pb != nullptr && avio_size(format.pb) > 0;
  return m_limit != nullptr && duration_ns() == 0 && !has_length;
}

double VideoFile::pixelAspect() const
{
  AVFormatContext &format = *m_libav->format;
  const double aspect = av_q2d(av_guess_sample_aspect_ratio(&format, format.streams[m_libav->stream], nullptr));
  constexpr double kMost = 2; // of any lens or format: beyond, the header is damaged
  if (!(aspect >= 1 / kMost && aspect <= kMost))
    return 1;
  return m_libav->quarter_turns % 2 == 0 ? aspect : 1 / aspect;
}

bool VideoFile::next(Picture &picture)
{
  while (m_ready.empty() && !m_is_at_end)
    decodeMore();
  if (m_ready.empty())
    return false;
  picture = std::move(m_ready.front());
  m_ready.pop_front();
  return true;
}

const Picture &VideoFile::firstWhole()
{
  for (std::size_t i = 0;; ++i) {
    while (i == m_ready.size() && !m_is_at_end)
      decodeMore();
    if (i == m_ready.size())
      throw ioError("{}: none of its {} pictures can be decoded", m_name, i);
    if (!m_ready[i].is_damaged)
      return m_ready[i];
  }
}

/// Feeds one packet of the stream, or the end of it, and takes what comes out.
void VideoFile::decodeMore()
{
  const QuietLibav quiet;
  AVPacket &packet = *m_libav->packet;
  allowReading(kSilence_s);
  const bool has_packet = av_read_frame(m_libav->format.get(), &packet) >= 0;
  if (has_packet && packet.stream_index != m_libav->stream) {
    av_packet_unref(&packet);
    return;
  }
  const bool is_hidden = has_packet && (packet.flags & AV_PKT_FLAG_DISCARD) != 0;
  m_counted += is_hidden;
  if (has_packet && packet.pts != AV_NOPTS_VALUE && !is_hidden)
    m_pending.insert(packet.pts);
  // A damaged packet is an error here; its place in m_pending is reported when a later picture comes.
  m_libav->decoder->send(has_packet ? &packet : nullptr);
  av_packet_unref(&packet);
  while (const AVFrame *frame = m_libav->decoder->receive())
    take(*frame);
  if (!has_packet) {
    reportLost(std::numeric_limits<std::int64_t>::max());
    reportMissing();
    m_is_at_end = true;
  }
}

std::int64_t VideoFile::stampOf(std::int64_t pts)
{
  const AVStream &stream = *m_libav->format->streams[m_libav->stream];
  const AVRational nanoseconds{1, 1'000'000'000};
  const double said_hz = av_q2d(stream.avg_frame_rate), rate_hz = said_hz > 1e-3 && said_hz < 1e6 ? said_hz : 25;
  const std::int64_t after_last = m_last_stamp_ns < 0 ? 0 : m_last_stamp_ns + std::llround(1e9 / rate_hz);
  std::int64_t stamp_ns = after_last;
  if (pts != AV_NOPTS_VALUE) {
    if (!m_has_first) {
      m_first_pts = pts;
      m_has_first = true;
    }
    constexpr double kLongest_s = 1e8; // three years: a time beyond it is damaged, and the rate goes on
    const double after_s = (static_cast<double>(pts) - static_cast<double>(m_first_pts)) * av_q2d(stream.time_base);
    if (std::abs(after_s) <= kLongest_s)
      stamp_ns = av_rescale_q(pts - m_first_pts, stream.time_base, nanoseconds);
  }
  if (stamp_ns <= m_last_stamp_ns) // a file whose times go back: the order of presentation is kept, and the rate
    stamp_ns = after_last;
  m_last_stamp_ns = stamp_ns;
  return stamp_ns;
}

void VideoFile::reportLost(std::int64_t before)
{
  while (!m_pending.empty() && *m_pending.begin() < before) {
    Picture lost;
    lost.stamp_ns = stampOf(*m_pending.begin());
    lost.is_damaged = true;
    lost.message = "could not be decoded";
    emit(std::move(lost));
    m_pending.erase(m_pending.begin());
  }
}

/// A file that was cut off: its container counts more pictures than came.
void VideoFile::reportMissing()
{
  constexpr std::size_t kMostBelievable = 10'000'000; // four days at 30 Hz: the count itself is damaged
  if (frames() > kMostBelievable)
    return;
  while (m_counted < frames()) {
    Picture missing;
    missing.stamp_ns = stampOf(AV_NOPTS_VALUE);
    missing.is_damaged = missing.is_missing = true;
    missing.message = fmt::format("the file ends before it: {} frames by its container", frames());
    emit(std::move(missing));
  }
}

void VideoFile::emit(Picture picture)
{
  m_ready.push_back(std::move(picture));
  ++m_counted;
}

void VideoFile::take(const AVFrame &frame)
{
  const std::int64_t pts = frame.best_effort_timestamp;
  if (pts != AV_NOPTS_VALUE) {
    reportLost(pts);
    m_pending.erase(pts);
  }
  Picture picture;
  picture.clock = pts;
  picture.stamp_ns = stampOf(pts);
  picture.is_damaged = PictureDecoder::isDamaged(frame);
  if (picture.is_damaged)
    picture.message = "damaged data, concealed by the decoder";
  const cv::Mat grey = m_libav->grey(frame);
  if (grey.empty()) {
    picture.is_damaged = true;
    picture.message = "pixel format cannot be converted to grey";
  }
  else {
    picture.image.resize(static_cast<unsigned>(grey.rows), static_cast<unsigned>(grey.cols));
    cv::Mat target(grey.rows, grey.cols, CV_8UC1, picture.image.bitmap);
    grey.copyTo(target);
  }
  emit(std::move(picture));
}
} // namespace bole
