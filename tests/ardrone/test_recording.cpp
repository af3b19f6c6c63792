// SPDX-License-Identifier: GPL-2.0-or-later
#include "flight.h"
#include "support/test.h"

#include "ardrone/bytes.h"
#include "ardrone/flight_folder.h"
#include "emulator/recording_reader.h"
#include <csignal>
#include <sys/wait.h>
#include <unistd.h>

using namespace bole;
using test::TemporaryFolder;

namespace
{
std::vector<std::uint8_t> bytesOf(const std::string &path)
{
  const std::string text = test::textOf(path);
  return {text.begin(), text.end()};
}

std::vector<RecordedPiece> all(RecordingReader &reader)
{
  std::vector<RecordedPiece> pieces;
  for (RecordedPiece piece; reader.next(piece);)
    pieces.push_back(piece);
  return pieces;
}

/// Twenty pieces of growing size; \return the end of each in the file.
std::vector<std::size_t> writeTwenty(const std::string &folder)
{
  RecordingWriter writer(folder);
  std::vector<std::size_t> ends;
  for (std::uint8_t i = 0; i < 20; ++i) {
    const std::vector<std::uint8_t> bytes(i * 7u, i);
    writer.write(i % 2 == 0 ? LinkChannel::video : LinkChannel::navdata, 1000 + i, bytes.data(), bytes.size());
    ends.push_back(writer.bytes());
  }
  EXPECT_EQ(writer.error(), "");
  return ends;
}
} // namespace

TEST(Recording, CutAtAnyByteItKeepsEveryPieceBeforeTheCut)
{
  const TemporaryFolder folder;
  const auto ends = writeTwenty(folder.path());
  auto bytes = bytesOf(folder / "raw.bin");
  ASSERT_EQ(bytes.size(), ends.back());
  for (std::size_t cut = bytes.size() + 1; cut-- > 0;) {
    RecordingReader reader(std::vector<std::uint8_t>(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(cut)));
    const auto whole = static_cast<std::size_t>(
        std::count_if(ends.begin(), ends.end(), [cut](std::size_t end) { return end <= cut; }));
    ASSERT_EQ(all(reader).size(), whole) << "cut at " << cut;
  }
}

TEST(Recording, ADamagedPieceIsSkippedAndTheOthersRead)
{
  const TemporaryFolder folder;
  const auto ends = writeTwenty(folder.path());
  auto bytes = bytesOf(folder / "raw.bin");
  bytes[ends[9] + 21] ^= 0xff;
  RecordingReader reader(std::move(bytes));
  const auto pieces = all(reader);
  ASSERT_EQ(pieces.size(), 19u);
  EXPECT_EQ(pieces[10].arrival_ns, 1011);
  EXPECT_EQ(pieces[10].bytes, std::vector<std::uint8_t>(77, 11));
  EXPECT_EQ(reader.skippedBytes(), ends[10] - ends[9] + 18); // and the title
}

TEST(Recording, OneOfNothingButBeginningsIsGivenUpAtTheCostOfAFewReadings)
{
  const TemporaryFolder folder;
  writeTwenty(folder.path());
  const auto good = bytesOf(folder / "raw.bin");
  std::vector<std::uint8_t> bytes;
  for (int i = 0; i < 100'000; ++i) {
    appendLittleEndian(bytes, std::uint32_t{0x45434542});
    bytes.push_back(1);
    bytes.resize(bytes.size() + 11);
    appendLittleEndian(bytes, std::uint32_t{1'000'000}); // bytes that are there, and of another sum
  }
  bytes.insert(bytes.end(), good.begin(), good.end());
  RecordingReader reader(bytes);
  RecordedPiece piece;
  EXPECT_FALSE(reader.next(piece)) << "the good ones at the end would be found by summing 50 GB";
  EXPECT_EQ(reader.skippedBytes(), bytes.size());
}

TEST(Recording, AKilledWriterLeavesAReadableRecording)
{
  const TemporaryFolder folder;
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    RecordingWriter writer(folder.path());
    const std::vector<std::uint8_t> bytes(5000, 7);
    for (std::int64_t i = 0;; ++i)
      writer.write(LinkChannel::video, i, bytes.data(), bytes.size());
  }
  test::eventually([&] {
    return std::filesystem::exists(folder / "raw.bin") && std::filesystem::file_size(folder / "raw.bin") > 200'000;
  });
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  RecordingReader reader(folder.path());
  const auto pieces = all(reader);
  EXPECT_GT(pieces.size(), 30u);
  for (std::size_t i = 0; i < pieces.size(); ++i)
    ASSERT_EQ(pieces[i].arrival_ns, static_cast<std::int64_t>(i));
  EXPECT_LT(reader.skippedBytes(), 5100u);
}

TEST(Recording, RefusesToWriteOverARecordingAndToReadAnythingElse)
{
  const TemporaryFolder folder;
  writeTwenty(folder.path());
  EXPECT_THROW(RecordingWriter(folder.path()), vpException);
  EXPECT_THROW(RecordingReader(folder / "nothing"), vpException);
  EXPECT_THROW(RecordingReader(folder.write("other.bin", "something else\n")), vpException);
}

TEST(Recording, ARecordedFlightIsServedAgain)
{
  for (const int generation : {1, 2}) {
    const TemporaryFolder folder;
    {
      RecordingWriter writer(folder.path());
      const auto emulator = test::emulate(generation, 40);
      DroneLink link(ArDroneAddress::parse(emulator->address()),
                     [&](LinkChannel channel, std::int64_t arrival_ns, const std::uint8_t *data, std::size_t size) {
                       writer.write(channel, arrival_ns, data, size);
                     });
      ASSERT_TRUE(emulator->wait(test::kPatience_s));
      ASSERT_TRUE(test::eventually([&] { return link.counters().video.frames + link.counters().video.skipped >= 38; }));
    }
    EXPECT_EQ(recordedGeneration(folder.path()), generation);
    ArDroneEmulator replay(makeRecordingFeed(folder.path()), {});
    replay.start();
    DroneLink link(ArDroneAddress::parse(replay.address()));
    LiveFrame last;
    double height = 0;
    EXPECT_TRUE(test::eventually([&] {
      if (link.next(last, 0.1) && last.body)
        height = last.body->height;
      return last.number == 40;
    }));
    EXPECT_EQ(last.status, FrameStatus::ok);
    EXPECT_NEAR(height, 1.55, 0.1);
  }
}
