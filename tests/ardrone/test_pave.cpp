// SPDX-License-Identifier: GPL-2.0-or-later
#include "files.h"
#include "support/test.h"

#include "ardrone/video_decoder.h"
#include "emulator/wire_format.h"

using namespace bole;

namespace
{
std::vector<std::uint8_t> envelope(std::uint32_t number, std::size_t payload, std::uint16_t header_size = 64)
{
  PaveHeader header;
  header.header_size = header_size;
  header.payload_size = static_cast<std::uint32_t>(payload);
  header.coded_width = header.display_width = 640;
  header.coded_height = 368;
  header.display_height = 360;
  header.frame_number = number;
  header.timestamp_ms = number * 33;
  header.frame_type = number % 15 == 0 ? PaveFrameType::idr : PaveFrameType::p;
  auto bytes = encodePaveHeader(header);
  bytes.resize(bytes.size() + payload, static_cast<std::uint8_t>(number));
  return bytes;
}

/// Frames of these numbers, each with \p payload bytes.
std::vector<std::uint8_t> stream(std::initializer_list<std::uint32_t> numbers, std::size_t payload)
{
  std::vector<std::uint8_t> bytes;
  for (const std::uint32_t number : numbers) {
    const auto frame = envelope(number, payload);
    bytes.insert(bytes.end(), frame.begin(), frame.end());
  }
  return bytes;
}

std::vector<PaveFrame> parseAll(PaveParser &parser, const std::vector<std::uint8_t> &bytes, std::size_t piece)
{
  std::vector<PaveFrame> frames;
  for (std::size_t at = 0; at < bytes.size(); at += piece) {
    parser.push(bytes.data() + at, std::min(piece, bytes.size() - at));
    while (auto frame = parser.next())
      frames.push_back(std::move(*frame));
  }
  return frames;
}
} // namespace

TEST(Pave, ReadsTheTwentyFramesThatADroneSent)
{
  const auto bytes = test::captured("pave.bin");
  if (bytes.empty())
    GTEST_SKIP() << "the captured stream is not here";
  PaveParser parser;
  const auto frames = parseAll(parser, bytes, 1000);
  ASSERT_EQ(frames.size(), 20u);
  EXPECT_EQ(parser.skippedBytes(), 0u);
  EXPECT_EQ(frames[0].header.frame_number, 17368u);
  EXPECT_EQ(frames[3].header.frame_type, PaveFrameType::idr);
  EXPECT_EQ(frames[3].header.header1_size, 14);
  EXPECT_EQ(frames[3].header.header2_size, 10);
  EXPECT_EQ(frames[19].header.timestamp_ms, 1792577759u);
  EXPECT_EQ(frames[19].header.display_height, 360);
}

TEST(Pave, DecodesTheSeventeenFramesFromTheFirstKeyFrameOn)
{
  const auto bytes = test::captured("pave.bin");
  if (bytes.empty())
    GTEST_SKIP() << "the captured stream is not here";
  DroneVideoDecoder decoder(2);
  int whole = 0;
  for (std::size_t at = 0; at < bytes.size(); at += 1000) // so that no frame waits for a key frame behind it
    for (const DecodedFrame &frame :
         decoder.decode(bytes.data() + at, std::min<std::size_t>(1000, bytes.size() - at))) {
      if (frame.message == "waits for a key frame")
        continue;
      EXPECT_NE(frame.status, FrameStatus::corrupt) << "frame " << frame.number << ": " << frame.message;
      EXPECT_EQ(frame.picture.width, 640);
      EXPECT_EQ(frame.picture.height, 360);
      ++whole;
    }
  EXPECT_EQ(whole, 17);
}

TEST(Pave, GivesTheSameFramesHoweverTheStreamIsCut)
{
  std::vector<std::uint8_t> bytes;
  for (std::uint32_t number = 0; number < 12; ++number) {
    const auto frame = envelope(number, 100 + 37 * number, number % 2 == 0 ? 64 : 68);
    bytes.insert(bytes.end(), frame.begin(), frame.end());
  }
  for (const std::size_t piece : {1u, 7u, 64u, 65u, 1000u, 100000u}) {
    PaveParser parser;
    const auto frames = parseAll(parser, bytes, piece);
    ASSERT_EQ(frames.size(), 12u) << "pieces of " << piece;
    for (std::uint32_t number = 0; number < 12; ++number) {
      EXPECT_EQ(frames[number].header.frame_number, number);
      EXPECT_EQ(frames[number].payload.size(), 100 + 37 * number);
      EXPECT_EQ(frames[number].payload.front(), number);
      EXPECT_FALSE(frames[number].after_gap);
    }
  }
}

TEST(Pave, FindsItsWayAfterADamagedHeaderAndSaysSo)
{
  auto bytes = stream({1, 2, 3}, 500);
  bytes[564] = 'X';
  PaveParser parser;
  const auto frames = parseAll(parser, bytes, 100);
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[1].header.frame_number, 3u);
  EXPECT_TRUE(frames[1].after_gap);
  EXPECT_EQ(parser.skippedBytes(), 564u);
  EXPECT_EQ(parser.resyncs(), 1u);
}

TEST(Pave, ADamagedLengthDoesNotSwallowTheFramesBehindIt)
{
  auto bytes = stream({1, 2, 3, 4}, 500);
  bytes[10] = 9; // 500 bytes become 590,324
  PaveParser parser;
  const auto frames = parseAll(parser, bytes, 100);
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(frames[0].header.frame_number, 2u);
  EXPECT_TRUE(frames[0].after_gap);
  EXPECT_FALSE(frames[1].after_gap);
}

TEST(Pave, AMissingFrameNumberIsAGap)
{
  const auto bytes = stream({1, 3}, 50);
  PaveParser parser;
  const auto frames = parseAll(parser, bytes, bytes.size());
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_FALSE(frames[0].after_gap);
  EXPECT_TRUE(frames[1].after_gap);
}

TEST(Pave, GetsThroughNoiseToTheNextFrame)
{
  std::mt19937 random(7);
  std::vector<std::uint8_t> bytes(5000);
  for (auto &byte : bytes)
    byte = static_cast<std::uint8_t>(random());
  std::copy_n("PaVE", 4, bytes.begin() + 1000); // a signature with nonsense behind
  const auto frame = envelope(9, 300);
  bytes.insert(bytes.end(), frame.begin(), frame.end());
  PaveParser parser;
  const auto frames = parseAll(parser, bytes, 333);
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(frames[0].header.frame_number, 9u);
  EXPECT_EQ(parser.skippedBytes(), 5000u);
}
