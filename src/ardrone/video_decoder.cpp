// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/video_decoder.h"

#include <algorithm>
#include <cstdlib>
#include <fmt/format.h>

extern "C" {
#include <libavutil/frame.h>
}

namespace bole
{
namespace
{
constexpr double kUnchanged = 0.7; // grey levels
constexpr int kBlock = 16;
constexpr std::size_t kSmallestPicture = 64; // bytes: 99 macroblocks of nothing and the headers
constexpr std::uint32_t kReordered = 30;     // pictures: two seconds; farther back it is a drone that was restarted

/// Mean over the blocks of 16x16 pixels of the change of their mean.
double blockChange(const YuvPicture &a, const YuvPicture &b)
{
  double total = 0;
  int blocks = 0;
  for (int top = 0; top + kBlock <= a.height; top += kBlock)
    for (int left = 0; left + kBlock <= a.width; left += kBlock, ++blocks) {
      int sum = 0;
      for (int v = top; v < top + kBlock; ++v)
        for (int u = left; u < left + kBlock; ++u)
          sum += a.y[static_cast<std::size_t>(v) * a.width + u] - b.y[static_cast<std::size_t>(v) * a.width + u];
      total += std::abs(sum) / static_cast<double>(kBlock * kBlock);
    }
  return blocks > 0 ? total / blocks : 0;
}

void copyPlane(const std::uint8_t *from, int stride, int width, int height, std::vector<std::uint8_t> &to)
{
  to.resize(static_cast<std::size_t>(width) * height);
  for (int row = 0; row < height; ++row)
    std::copy_n(from + static_cast<std::ptrdiff_t>(row) * stride, width,
                to.begin() + static_cast<std::ptrdiff_t>(row) * width);
}
} // namespace

DroneVideoDecoder::DroneVideoDecoder(int generation) : m_generation(generation) {}

void DroneVideoDecoder::restart()
{
  m_last_number.reset();
  m_parser.reset();
  m_h264.flush();
  m_needs_key = true;
}

/// Why there is no whole picture, empty where there is one. Whatever libavcodec says about damage (an error, a missing
/// reference, concealed blocks) counts: it conceals by copying, which for a tracker is worse than nothing.
std::string DroneVideoDecoder::decodeH264(const PaveFrame &frame, YuvPicture &picture)
{
  if (!m_h264.send(frame.payload.data(), frame.payload.size()))
    return "the decoder refused the frame";
  const AVFrame *decoded = m_h264.receive();
  if (decoded == nullptr)
    return m_h264.hasFailed() ? "the frame could not be decoded" : "the decoder gave no picture";
  if (!PictureDecoder::isYuv420(*decoded))
    return "the frame is not YCbCr 4:2:0";
  picture.width = std::min<int>(frame.header.display_width, decoded->width);
  picture.height = std::min<int>(frame.header.display_height, decoded->height);
  copyPlane(decoded->data[0], decoded->linesize[0], picture.width, picture.height, picture.y);
  copyPlane(decoded->data[1], decoded->linesize[1], (picture.width + 1) / 2, (picture.height + 1) / 2, picture.cb);
  copyPlane(decoded->data[2], decoded->linesize[2], (picture.width + 1) / 2, (picture.height + 1) / 2, picture.cr);
  return PictureDecoder::isDamaged(*decoded) ? "parts of the frame were concealed" : "";
}

DecodedFrame DroneVideoDecoder::decodePave(const PaveFrame &frame)
{
  DecodedFrame out;
  out.number = frame.header.frame_number;
  out.timestamp_ms = frame.header.timestamp_ms;
  const bool is_key = frame.header.frame_type == PaveFrameType::idr;
  m_needs_key = (m_needs_key || frame.after_gap) && !is_key;
  if (m_needs_key) {
    out.status = FrameStatus::corrupt;
    out.message = "waits for a key frame";
    return out;
  }
  out.message = decodeH264(frame, out.picture);
  if (!out.message.empty()) {
    m_needs_key = true;
    m_h264.flush();
    out.status = FrameStatus::corrupt;
  }
  out.picture.number = out.number;
  return out;
}

void DroneVideoDecoder::judge(DecodedFrame &frame)
{
  if (frame.status == FrameStatus::ok) {
    if (m_width == 0) {
      m_width = frame.picture.width;
      m_height = frame.picture.height;
    }
    if (frame.picture.width != m_width || frame.picture.height != m_height) {
      frame.status = FrameStatus::resized;
      frame.message = fmt::format("{}x{} after {}x{}", frame.picture.width, frame.picture.height, m_width, m_height);
    }
    else if (frame.picture.y == m_last.y) {
      frame.status = FrameStatus::stale;
      frame.unchanged = true;
      frame.message = fmt::format("the picture of frame {} again", m_last.number);
    }
    else if (!m_last.empty() && blockChange(frame.picture, m_last) < kUnchanged) {
      frame.unchanged = true; // m_last stays: slow changes add up
    }
    else {
      m_last = frame.picture;
    }
  }
  ++m_counters.frames;
  m_counters.ok += frame.status == FrameStatus::ok ? 1 : 0;
  m_counters.corrupt += frame.status == FrameStatus::corrupt ? 1 : 0;
  m_counters.stale += frame.status == FrameStatus::stale ? 1 : 0;
  m_counters.resized += frame.status == FrameStatus::resized ? 1 : 0;
}

std::vector<DecodedFrame> DroneVideoDecoder::decode(const std::uint8_t *data, std::size_t size)
{
  std::vector<DecodedFrame> out;
  if (m_generation == 1) {
    if (size < kSmallestPicture) {
      ++m_counters.refused;
      return out;
    }
    UvlcResult result = decodeUvlc(data, size);
    DecodedFrame frame;
    frame.status = result.whole ? FrameStatus::ok : FrameStatus::corrupt;
    frame.message = std::move(result.message);
    frame.number = result.picture.number;
    frame.picture = std::move(result.picture);
    if (frame.status == FrameStatus::ok && m_last_number && frame.number <= *m_last_number &&
        *m_last_number - frame.number < kReordered) {
      ++m_counters.refused; // a datagram that was overtaken, or sent again
      return out;
    }
    if (frame.status == FrameStatus::ok)
      m_last_number = frame.number;
    judge(frame);
    out.push_back(std::move(frame));
    return out;
  }
  m_parser.push(data, size);
  std::vector<PaveFrame> waiting;
  while (auto frame = m_parser.next()) {
    if (frame->header.frame_type == PaveFrameType::idr) {
      m_counters.skipped += waiting.size();
      waiting.clear();
    }
    waiting.push_back(std::move(*frame));
  }
  for (const PaveFrame &frame : waiting) {
    out.push_back(decodePave(frame));
    judge(out.back());
  }
  m_counters.resyncs = m_parser.resyncs();
  m_counters.skipped_bytes = m_parser.skippedBytes();
  return out;
}
} // namespace bole
