// SPDX-License-Identifier: GPL-2.0-or-later
// What one damaged or lost frame of an AR.Drone 2 costs, wherever in the stream it is.
#include "flight.h"
#include "support/test.h"

#include "ardrone/uvlc.h"
#include "ardrone/video_decoder.h"
#include "emulator/emulator_packets.h"
#include "emulator/wire_format.h"

using namespace bole;

namespace
{
using Bytes = std::vector<std::uint8_t>;
constexpr int kKeyInterval = 15;
constexpr std::size_t kHeader = 64;

/// PaVE frames of a flight, a key frame every kKeyInterval.
std::vector<Bytes> encodedFlight(std::size_t count)
{
  test::MadeUpFlight flight(count);
  VideoPacketEncoder encoder({160, 128, 20, 1.3e6, false, kKeyInterval, "keyint=15:min-keyint=15:scenecut=0"});
  std::vector<Bytes> frames;
  for (Frame frame; flight.next(frame);) {
    const auto packet = encoder.encode(frame.image);
    EXPECT_EQ(packet.is_key, frames.size() % kKeyInterval == 0);
    PaveHeader header;
    header.frame_number = static_cast<std::uint32_t>(frames.size() + 1);
    header.timestamp_ms = static_cast<std::uint32_t>(50 * frames.size());
    header.display_width = 160;
    header.display_height = 120;
    frames.push_back(paveFrame(encoder, packet, header));
  }
  return frames;
}

enum class Damage
{
  lost,
  header,
  length,
  half,
  payload
};

Bytes damaged(Bytes frame, Damage damage)
{
  std::mt19937 random(5);
  switch (damage) {
  case Damage::lost:
    return {};
  case Damage::header:
    frame[1] ^= 0x20;
    break;
  case Damage::length:
    frame[10] ^= 0x09; // 64 KiB and more
    break;
  case Damage::half:
    frame.resize(frame.size() / 2);
    break;
  case Damage::payload:
    for (std::size_t at = kHeader; at < frame.size(); at += 7)
      frame[at] = static_cast<std::uint8_t>(random());
    break;
  }
  return frame;
}

/// Numbers of the frames that are `ok` when \p frames come one by one.
std::vector<std::uint32_t> whole(const std::vector<Bytes> &frames)
{
  DroneVideoDecoder decoder(2);
  std::vector<std::uint32_t> numbers;
  for (const Bytes &bytes : frames)
    for (const DecodedFrame &frame : decoder.decode(bytes.data(), bytes.size()))
      if (frame.status == FrameStatus::ok)
        numbers.push_back(frame.number);
  return numbers;
}
} // namespace

TEST(DroneVideoDecoder, IsWholeAgainFromTheNextKeyFrameOnWhateverWasDamagedWherever)
{
  const auto good = encodedFlight(50);
  ASSERT_EQ(whole(good).size(), 50u);
  std::size_t longest = 0;
  for (const Damage damage : {Damage::lost, Damage::header, Damage::length, Damage::half, Damage::payload})
    for (std::size_t hit = 0; hit < 2 * kKeyInterval; ++hit) {
      auto frames = good;
      frames[hit] = damaged(frames[hit], damage);
      const auto numbers = whole(frames);
      const std::size_t key = (hit / kKeyInterval + 1) * kKeyInterval;
      for (std::size_t i = 0; i < hit; ++i)
        EXPECT_EQ(numbers.at(i), i + 1); // what came before is not touched
      std::size_t after = 0;
      for (const std::uint32_t number : numbers)
        after += number > key ? 1 : 0;
      EXPECT_EQ(after, good.size() - key) << "damage " << static_cast<int>(damage) << " in frame " << hit + 1;
      longest = std::max(longest, good.size() - numbers.size());
    }
  RecordProperty("most_frames_lost", static_cast<int>(longest));
  EXPECT_LE(longest, kKeyInterval);
  EXPECT_GT(longest, 0u);
}

TEST(DroneVideoDecoder, ADatagramThatWasOvertakenIsNoFrame)
{
  test::MadeUpFlight flight(4);
  std::vector<Bytes> pictures;
  for (Frame frame; flight.next(frame);)
    pictures.push_back(encodeUvlc(frame.image, static_cast<std::uint32_t>(frame.index + 1)));
  DroneVideoDecoder decoder(1);
  std::vector<std::uint32_t> numbers;
  for (const std::size_t k : {0u, 2u, 1u, 2u, 3u})
    for (const DecodedFrame &frame : decoder.decode(pictures[k].data(), pictures[k].size()))
      numbers.push_back(frame.number);
  EXPECT_EQ(numbers, (std::vector<std::uint32_t>{1, 3, 4}));
  EXPECT_EQ(decoder.counters().refused, 2u);
}
