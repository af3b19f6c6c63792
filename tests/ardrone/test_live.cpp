// SPDX-License-Identifier: GPL-2.0-or-later
// The live path against the emulator. Nothing here measures time; limits are for machines that hang.
#include "flight.h"
#include "support/test.h"

using namespace bole;
using test::addressOf;
using test::emulate;
using test::eventually;

namespace
{
struct Flown
{
  std::vector<Frame> frames;
  std::vector<std::uint32_t> numbers;
  LinkCounters counters;
  ArDroneEmulator::Counters sent;
};

/// All that comes until an emulated flight of \p count frames is over and the source has given what it has.
Flown fly(int generation, std::size_t count, const ArDroneEmulator::Options &emulated = {})
{
  const auto emulator = emulate(generation, count, emulated);
  ArDroneSource::Options options;
  options.give_up_s = 2; // longer than the reboot below
  options.grabber.open_timeout_s = test::kPatience_s;
  ArDroneSource source(addressOf(*emulator).toString(), options);
  Flown flown;
  std::vector<Frame> &frames = flown.frames;
  frames.reserve(1000); // ViSP copies empty images by memcpy from null
  for (;;) {
    Frame frame; // a new one each time: ViSP 3.5 leaks what is assigned to an image moved from
    if (!source.next(frame))
      break;
    frames.push_back(std::move(frame));
    flown.numbers.push_back(source.liveFrame().number);
  }
  flown.counters = source.counters();
  flown.sent = emulator->counters();
  for (std::size_t i = 1; i < frames.size(); ++i)
    EXPECT_GT(frames[i].stamp_ns, frames[i - 1].stamp_ns) << i;
  return flown;
}

/// Twice as fast as life.
ArDroneEmulator::Options quick()
{
  ArDroneEmulator::Options options;
  options.speed = 2;
  return options;
}

} // namespace

class Live : public testing::TestWithParam<int>
{
};
INSTANTIATE_TEST_SUITE_P(Generation, Live, testing::Values(1, 2),
                         [](const auto &generation) { return "ArDrone" + std::to_string(generation.param); });

TEST_P(Live, GivesFramesWithTheMotionThatWasFlown)
{
  const auto [frames, numbers, counters, sent] = fly(GetParam(), 60);
  const double largest_error_m = 0.25; // 1 m/s: a quarter of a second of a machine that stumbles
  int checked = 0;
  std::optional<Pose> first_seen, first_flown;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (frames[i].status != FrameStatus::ok || !frames[i].wMb_odometry)
      continue;
    const Pose flown = test::MadeUpFlight::pose((numbers[i] - 1) * 0.05);
    EXPECT_EQ(frames[i].image.getWidth(), 160u);
    if (!first_seen) {
      first_seen = frames[i].wMb_odometry;
      first_flown = flown;
    }
    const Vector6d error = (first_seen->inverse() * *frames[i].wMb_odometry).minus(first_flown->inverse() * flown);
    EXPECT_LT(error.head<3>().norm(), largest_error_m);
    EXPECT_LT(error.tail<3>().norm(), 0.1);
    EXPECT_NEAR(frames[i].wMb_odometry->t.z(), flown.t.z(),
                0.05); // the sonar knows the height itself
    ++checked;
  }
  EXPECT_GT(checked, 5);
}

TEST_P(Live, ASlowConsumerGetsTheNewestFrameAndTheOthersAreCounted)
{
  const auto emulator = emulate(GetParam(), 60);
  DroneLink link(ArDroneAddress::parse(emulator->address()));
  LiveFrame frame;
  ASSERT_TRUE(emulator->wait(test::kPatience_s));
  ASSERT_TRUE(eventually([&] { return link.counters().video.frames + link.counters().video.skipped >= 50; }));
  ASSERT_TRUE(eventually([&] {
    const auto a = link.counters().video.frames;
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    return a == link.counters().video.frames;
  }));
  ASSERT_TRUE(link.next(frame, 1));
  EXPECT_EQ(frame.number, 60u);
  EXPECT_FALSE(link.next(frame, 0.01));
  const LinkCounters counters = link.counters();
  EXPECT_EQ(counters.delivered, 1u);
  EXPECT_EQ(counters.dropped + counters.delivered, counters.video.frames);
}

TEST_P(Live, ComesBackByItselfAfterAReboot)
{
  ArDroneEmulator::Options options = quick();
  options.reboot_at_s = 1.5;
  options.reboot_for_s = 0.5;
  const auto [frames, numbers, counters, sent] = fly(GetParam(), 120, options);
  EXPECT_EQ(sent.reboots, 1u);
  EXPECT_GE(counters.connections, GetParam() == 2 ? 2u : 1u);
  EXPECT_EQ(counters.navdata_restarts, 1u);
  // Frames of before and of after, and an odometry that goes on: nothing jumps by more than was flown.
  // The last ones may be too fresh for navdata on a slow machine: the newest that has some.
  const auto last = std::find_if(frames.rbegin(), frames.rend(),
                                 [](const Frame &f) { return f.status == FrameStatus::ok && f.wMb_odometry; });
  ASSERT_NE(last, frames.rend());
  EXPECT_GT(last->stamp_ns - frames.front().stamp_ns,
            1'000'000'000); // the reboot was in the first 1.5 s, of the host's or the drone's clock
  EXPECT_LT((last->wMb_odometry->t - frames.front().wMb_odometry->t).norm(), 8);
}

TEST_P(Live, ClocksThatWrapAreNotNoticed)
{
  ArDroneEmulator::Options options = quick();
  options.clock_wrap = true; // both clocks wrap after 3 s
  const auto [frames, numbers, counters, sent] = fly(GetParam(), 120, options);
  EXPECT_EQ(counters.clock_jumps, 0u);
  EXPECT_EQ(counters.navdata_restarts, 0u);
  double travelled = 0;
  const Frame *before = nullptr;
  for (const Frame &frame : frames)
    if (frame.wMb_odometry) {
      if (before != nullptr)
        travelled += (frame.wMb_odometry->t - before->wMb_odometry->t).norm();
      before = &frame;
    }
  EXPECT_GT(travelled, 2);
  EXPECT_LT(travelled, 9);
}

TEST_P(Live, LosesAndJittersPacketsWithoutLosingTheThread)
{
  ArDroneEmulator::Options options = quick();
  options.loss = 0.1;
  options.jitter_s = 0.03;
  const auto [frames, numbers, counters, sent] = fly(GetParam(), 80, options);
  EXPECT_GT(sent.lost, 0u);
  EXPECT_GT(std::count_if(frames.begin(), frames.end(), [](const Frame &f) { return f.status == FrameStatus::ok; }), 5);
  if (GetParam() == 2) {
    EXPECT_GT(counters.video.corrupt, 0u); // frames that refer to lost ones
  }
}

TEST_P(Live, CorruptionNeitherCrashesNorStopsIt)
{
  ArDroneEmulator::Options options = quick();
  options.corrupt = 0.2;
  options.key_interval = 5;
  const auto [frames, numbers, counters, sent] = fly(GetParam(), 120, options);
  EXPECT_GT(sent.corrupted_navdata, 0u);
  EXPECT_EQ(counters.navdata_restarts, 0u);
  EXPECT_GT(counters.navdata_refused, 0u);
  EXPECT_GT(counters.video.corrupt, 0u);
  EXPECT_GT(counters.video.ok, 0u);
}

TEST_P(Live, AFrozenCameraIsStale)
{
  ArDroneEmulator::Options options = quick();
  options.freeze_at_s = 1;
  options.freeze_for_s = 1.5; // frames 21 to 50
  const auto [frames, numbers, counters, sent] = fly(GetParam(), 80, options);
  int stale = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (frames[i].status == FrameStatus::missing)
      continue;
    const bool frozen = numbers[i] > 25 && numbers[i] <= 50; // the body must have moved on a little first
    if (frozen) {
      EXPECT_NE(frames[i].status, FrameStatus::ok) << "frame " << numbers[i];
    }
    stale += frames[i].status == FrameStatus::stale ? 1 : 0;
  }
  EXPECT_GT(stale, 0);
}

TEST_P(Live, AStallOfTheVideoKeepsTheMotion)
{
  ArDroneEmulator::Options options;
  options.stall_at_s = 2; // the source has settled, on a slow machine too
  options.stall_for_s = 1.5;
  const auto [frames, numbers, counters, sent] = fly(GetParam(), 100, options);
  int missing = 0;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    const Frame &frame = frames[i], &before = frames[i - 1];
    if (frame.status != FrameStatus::missing || !frame.wMb_odometry || !before.wMb_odometry)
      continue;
    // about 1.05 m/s (forward and swaying) is flown over the time that the stamps say has passed
    const double seconds = static_cast<double>(frame.stamp_ns - before.stamp_ns) * 1e-9;
    EXPECT_NEAR((frame.wMb_odometry->t - before.wMb_odometry->t).norm(), 1.05 * seconds, 0.1 + 0.1 * seconds);
    EXPECT_FALSE(frame.gyro.empty());
    ++missing;
  }
  EXPECT_GT(missing, 0);
}

TEST_P(Live, SilenceIsMissingFramesAndThenAnEnd)
{
  const std::vector<Frame> frames = fly(GetParam(), 30).frames;
  ASSERT_FALSE(frames.empty());
  EXPECT_EQ(frames.back().status, FrameStatus::missing);
  EXPECT_EQ(frames.back().image.getSize(), 0u);
  EXPECT_FALSE(frames.back().message.empty());
}

TEST(LiveSource, SaysWhenNobodyAnswersOrTheCameraDoesNotFit)
{
  ArDroneAddress nobody;
  nobody.host = "127.0.0.1";
  nobody.navdata_port = nobody.video_port = nobody.at_port = 1;
  ArDroneSource::Options options;
  options.grabber.open_timeout_s = 0.3;
  EXPECT_THROW(ArDroneSource(nobody.toString(), options), vpException);
  const auto emulator = emulate(2, 40);
  options.grabber.open_timeout_s = test::kPatience_s;
  EXPECT_THROW(ArDroneSource(emulator->address(), options),
               vpException); // 160x120 is not the shape of 640x360
}

TEST(LiveSource, FindsTheGenerationOut)
{
  for (const int generation : {1, 2}) {
    const auto emulator = emulate(generation, 40);
    ArDroneAddress address = ArDroneAddress::parse(emulator->address());
    address.generation = 0;
    vpArDroneGrabber::Options options;
    options.open_timeout_s = test::kPatience_s;
    vpArDroneGrabber grabber(address.toString(), options);
    vpImage<vpRGBa> image;
    grabber.open(image);
    EXPECT_EQ(grabber.getLink().generation(), generation);
    EXPECT_EQ(image.getWidth(), 160u);
    EXPECT_EQ(grabber.getWidth(), 160u);
    EXPECT_NEAR(image[60][80].R, image[60][80].B, 12); // grey
  }
}
