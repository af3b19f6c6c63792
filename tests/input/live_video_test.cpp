// SPDX-License-Identifier: GPL-2.0-or-later
// Streams by their address, from a camera behind HTTP on this machine.
#include "support/test.h"

#include "input/live_video.h"
#include "input/steady_clock.h"
#include "output/video_writer.h"
#include <arpa/inet.h>
#include <atomic>
#include <netinet/in.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sys/socket.h>
#include <thread>
#include <unistd.h>

extern "C" {
#include <libavformat/avformat.h>
}

using namespace bole;

namespace
{
using testing::HasSubstr;

constexpr int kWidth = 160, kHeight = 120;

/// A wall that passes by.
cv::Mat picture(int k)
{
  cv::Mat wall(kHeight, kWidth, CV_8UC1);
  for (int v = 0; v < kHeight; ++v)
    for (int u = 0; u < kWidth; ++u)
      wall.at<unsigned char>(v, u) =
          static_cast<unsigned char>(128 + 50 * std::sin(0.2 * (u + 3 * k)) + 40 * std::sin(0.13 * v + 0.07 * u));
  return wall;
}

/// Answers one connection after the other with what is given for it.
class HttpServer
{
public:
  /// \p answer: writes to the socket of a connection, and is told how many there were before.
  explicit HttpServer(std::function<void(int socket, int before)> answer)
  {
    m_listening = socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(bind(m_listening, reinterpret_cast<sockaddr *>(&address), sizeof address), 0);
    EXPECT_EQ(listen(m_listening, 4), 0);
    socklen_t size = sizeof address;
    getsockname(m_listening, reinterpret_cast<sockaddr *>(&address), &size);
    m_port = ntohs(address.sin_port);
    m_thread = std::thread([this, answer = std::move(answer)] {
      for (int count = 0;; ++count) {
        const int connection = accept(m_listening, nullptr, nullptr);
        if (connection < 0 || m_is_closed)
          return;
        char request[4096];
        if (recv(connection, request, sizeof request, 0) > 0)
          answer(connection, count);
        close(connection);
      }
    });
  }
  ~HttpServer() { end(); }
  void end()
  {
    if (m_is_closed.exchange(true))
      return;
    shutdown(m_listening, SHUT_RDWR);
    m_thread.join();
    close(m_listening);
  }
  std::string address() const { return fmt::format("http://127.0.0.1:{}/camera", m_port); }
  const std::atomic<bool> &isClosed() const { return m_is_closed; }

private:
  int m_listening = -1, m_port = 0;
  std::atomic<bool> m_is_closed{false};
  std::thread m_thread;
};

bool sendAll(int socket, const std::string &bytes)
{
  for (std::size_t at = 0; at < bytes.size();) {
    const ssize_t sent = send(socket, bytes.data() + at, bytes.size() - at, MSG_NOSIGNAL);
    if (sent <= 0)
      return false;
    at += static_cast<std::size_t>(sent);
  }
  return true;
}

/// \p count pictures as a camera of the network sends them, 50 a second; all that it can where \p count is 0.
void sendPictures(int socket, int count)
{
  sendAll(socket, "HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=next\r\n\r\n");
  for (int k = 0; count == 0 || k < count; ++k) {
    std::vector<unsigned char> jpeg;
    cv::imencode(".jpg", picture(k), jpeg);
    const std::string head =
        fmt::format("--next\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", jpeg.size());
    if (!sendAll(socket, head + std::string(jpeg.begin(), jpeg.end()) + "\r\n"))
      return;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

TEST(LiveVideo, GivesTheNewestPictureWithRisingStampsAndCountsThoseThatItSkips)
{
  HttpServer server([](int socket, int) { sendPictures(socket, 0); });
  const auto source = openStream(server.address(), {});
  auto *live = dynamic_cast<LiveVideoSource *>(source.get());
  ASSERT_NE(live, nullptr) << "a stream without an end is live";
  EXPECT_EQ(live->camera().width, kWidth);
  EXPECT_THAT(live->note(), HasSubstr("field of view"));
  std::int64_t last_ns = -1;
  int good = 0;
  for (int i = 0; i < 6; ++i) {
    Frame frame;
    ASSERT_TRUE(live->next(frame));
    EXPECT_GT(frame.stamp_ns, last_ns);
    last_ns = frame.stamp_ns;
    good += frame.status == FrameStatus::ok && frame.image.getWidth() == kWidth && frame.arrival_ns > 0;
    std::this_thread::sleep_for(std::chrono::milliseconds(150)); // a slow consumer
  }
  EXPECT_GE(good, 4);
  EXPECT_GT(live->counters().pictures, 6u);
  EXPECT_GT(live->counters().dropped, 0u);
  live->stop();
  Frame frame;
  EXPECT_FALSE(live->next(frame));
}

TEST(LiveVideo, ConnectsAgainAndEndsWhereNothingComesAnyMore)
{
  HttpServer server([](int socket, int before) {
    if (before < 2)
      sendPictures(socket, 10);
  });
  const std::string secret = "http://user:secret@" + server.address().substr(7);
  LiveVideoSource live(secret, {}, 3);
  EXPECT_EQ(live.name(), server.address());
  std::size_t pictures = 0, missing = 0;
  std::int64_t last_ns = -1;
  std::string why;
  for (Frame frame; live.next(frame);) {
    EXPECT_GT(frame.stamp_ns, last_ns);
    EXPECT_THAT(frame.message, testing::Not(HasSubstr("secret")));
    last_ns = frame.stamp_ns;
    pictures += frame.image.getSize() > 0;
    if (frame.status == FrameStatus::missing) {
      ++missing;
      why = frame.message;
    }
  }
  EXPECT_GE(live.counters().connections, 2u);
  EXPECT_GT(live.counters().pictures, 12u) << "of the second connection, too";
  EXPECT_GT(pictures, 2u);
  EXPECT_GT(missing, 0u);
  EXPECT_THAT(why, HasSubstr("127.0.0.1"));
}

/// The bytes of an MP4 of 25 pictures in a second.
std::string recording()
{
  const test::TemporaryFolder folder;
  const std::string path = folder / "recording.mp4";
  VideoWriter video(path);
  for (int k = 0; k < 25; ++k) {
    vpImage<vpRGBa> colour(kHeight, kWidth);
    const cv::Mat grey = picture(k);
    for (unsigned i = 0; i < colour.getSize(); ++i)
      colour.bitmap[i] = vpRGBa(grey.data[i], grey.data[i], grey.data[i]);
    video.write(colour, k * 40'000'000LL);
  }
  video.finish();
  return test::textOf(path);
}

/// The same as an MPEG transport stream, which does not tell how long it is.
std::string transportStream()
{
  const test::TemporaryFolder folder;
  const std::string path = folder.write("recording.mp4", recording());
  AVFormatContext *in = nullptr, *out = nullptr;
  EXPECT_GE(avformat_open_input(&in, path.c_str(), nullptr, nullptr), 0);
  EXPECT_GE(avformat_alloc_output_context2(&out, nullptr, "mpegts", nullptr), 0);
  EXPECT_GE(avcodec_parameters_copy(avformat_new_stream(out, nullptr)->codecpar, in->streams[0]->codecpar), 0);
  EXPECT_GE(avio_open_dyn_buf(&out->pb), 0);
  EXPECT_GE(avformat_write_header(out, nullptr), 0);
  AVPacket *packet = av_packet_alloc();
  while (av_read_frame(in, packet) >= 0) {
    av_packet_rescale_ts(packet, in->streams[0]->time_base, out->streams[0]->time_base);
    av_interleaved_write_frame(out, packet);
  }
  av_packet_free(&packet);
  av_write_trailer(out);
  std::uint8_t *bytes = nullptr;
  const int size = avio_close_dyn_buf(out->pb, &bytes);
  const std::string stream(bytes, bytes + size);
  av_free(bytes);
  avformat_free_context(out);
  avformat_close_input(&in);
  return stream;
}

TEST(LiveVideo, ARecordingBehindAnAddressIsReadWhole)
{
  for (const std::string &bytes : {recording(), transportStream()}) {
    HttpServer server([&](int socket, int) {
      sendAll(socket, fmt::format("HTTP/1.0 200 OK\r\nContent-Length: {}\r\n\r\n", bytes.size()) + bytes);
    });
    const auto source = openStream("http://user:secret@" + server.address().substr(7), {});
    EXPECT_EQ(dynamic_cast<LiveVideoSource *>(source.get()), nullptr);
    EXPECT_EQ(source->name(), server.address());
    int frames = 0;
    for (Frame frame; source->next(frame); ++frames)
      EXPECT_EQ(frame.stamp_ns, frames * 40'000'000LL);
    EXPECT_EQ(frames, 25);
  }
}

TEST(LiveVideo, ARecordingOfUntoldLengthEnds)
{
  const std::string bytes = transportStream();
  HttpServer server([&](int socket, int) { sendAll(socket, "HTTP/1.0 200 OK\r\n\r\n" + bytes); });
  const auto source = openStream(server.address(), {}, 3600); // a silence is not what ends it
  ASSERT_NE(dynamic_cast<LiveVideoSource *>(source.get()), nullptr);
  std::int64_t last_ns = -1'000'000;
  for (Frame frame; source->next(frame); last_ns = frame.stamp_ns)
    EXPECT_GT(frame.stamp_ns, last_ns + 1000) << "1 us";
  EXPECT_GE(last_ns, 960'000'000);
}

TEST(LiveVideo, WaitsLongerFromAttemptToAttempt)
{
  RetryPause pause(0.5, 3);
  for (const double expected : {0.5, 1.0, 2.0, 3.0, 3.0})
    EXPECT_EQ(pause.next().count(), expected);
  pause.reset();
  EXPECT_EQ(pause.next().count(), 0.5);
}

TEST(LiveVideo, WhatDoesNotAnswerIsNamed)
{
  HttpServer server([](int socket, int) { sendAll(socket, "HTTP/1.0 200 OK\r\n\r\nhello"); });
  EXPECT_REFUSED("http://127.0.0.1:1/none: no video", openStream("http://user:secret@127.0.0.1:1/none", {}));
  EXPECT_REFUSED("/dev/video987: no camera", openStream("/dev/video987", {}));
  EXPECT_REFUSED("no video", openStream(server.address(), {}));
}

TEST(LiveVideo, OnlyAddressesAndCamerasAreTakenForStreams)
{
  for (const char *address : {"rtsp://10.0.0.2/live", "http://camera/mjpeg", "file:///tmp/pipe", "/dev/video0"})
    EXPECT_TRUE(LiveVideoSource::accepts(address)) << address;
  for (const char *other : {"ardrone://192.168.1.1", "walk.mp4", "data/park-forward", "/dev/null"})
    EXPECT_FALSE(LiveVideoSource::accepts(other)) << other;
}
} // namespace
