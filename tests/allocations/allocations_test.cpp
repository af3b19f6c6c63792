// SPDX-License-Identifier: GPL-2.0-or-later
// How often a frame in flight asks for memory, once the window is full, and how much of it stays. Counts operator new
// of all libraries; what OpenCV and Eigen take by malloc are images and a few matrices.
#include "support/test.h"

#include <atomic>
#include <bole/open_source.h>
#include <bole/pipeline.h>
#include <malloc.h>
#include <new>

namespace
{
std::atomic<bool> is_counting{false};
std::atomic<long> allocations{0}, live_bytes{0};

void *allocate(std::size_t size, std::size_t alignment)
{
  if (is_counting)
    ++allocations;
  const std::size_t asked = std::max<std::size_t>(size, 1);
  void *memory = alignment <= alignof(std::max_align_t)
                     ? std::malloc(asked)
                     : std::aligned_alloc(alignment, (asked + alignment - 1) / alignment * alignment);
  if (!memory)
    throw std::bad_alloc();
  live_bytes += static_cast<long>(malloc_usable_size(memory));
  return memory;
}

void release(void *memory) noexcept
{
  live_bytes -= static_cast<long>(malloc_usable_size(memory));
  std::free(memory);
}
} // namespace

void *operator new(std::size_t size) { return allocate(size, 1); }
void *operator new[](std::size_t size) { return allocate(size, 1); }
void *operator new(std::size_t size, std::align_val_t alignment) { return allocate(size, std::size_t(alignment)); }
void *operator new[](std::size_t size, std::align_val_t alignment) { return allocate(size, std::size_t(alignment)); }
void operator delete(void *memory) noexcept { release(memory); }
void operator delete[](void *memory) noexcept { release(memory); }
void operator delete(void *memory, std::size_t) noexcept { release(memory); }
void operator delete[](void *memory, std::size_t) noexcept { release(memory); }
void operator delete(void *memory, std::align_val_t) noexcept { release(memory); }
void operator delete[](void *memory, std::align_val_t) noexcept { release(memory); }
void operator delete(void *memory, std::size_t, std::align_val_t) noexcept { release(memory); }
void operator delete[](void *memory, std::size_t, std::align_val_t) noexcept { release(memory); }

namespace
{
TEST(Allocations, AreFewInAFrameOfSteadyFlight)
{
  constexpr std::size_t kWarm = 60, kCounted = 30;
  const auto source = bole::openSource(BOLE_SOURCE_DIR "/data/park-forward");
  bole::Pipeline pipeline(source->camera(), source->bMc());
  std::vector<bole::Frame> frames;
  for (bole::Frame frame; frames.size() < kWarm + kCounted && source->next(frame);)
    frames.push_back(frame);
  ASSERT_EQ(frames.size(), kWarm + kCounted);
  for (std::size_t i = 0; i < kWarm; ++i)
    pipeline.process(frames[i]);
  is_counting = true;
  for (std::size_t i = kWarm; i < frames.size(); ++i)
    pipeline.process(frames[i]);
  is_counting = false;
  const double a_frame = static_cast<double>(allocations) / kCounted;
  RecordProperty("allocations_a_frame", std::to_string(a_frame));
  // What remains: the graph and the map grow with the flight, each report is the caller's, and every trunk that is
  // looked for (60 a frame) has lists of peaks and pairs.
  EXPECT_LT(a_frame, 2400); // 2,222 now
  EXPECT_GT(a_frame, 10);   // else nothing was counted
}

/// Bytes that a flight to and fro past the same trunks keeps for each frame: its mean over the last two rounds against
/// that over rounds two and three.
double keptAFrame(double lag_s, std::size_t rounds)
{
  const auto source = bole::openSource(BOLE_SOURCE_DIR "/data/park-forward");
  std::vector<bole::Frame> there;
  for (bole::Frame frame; source->next(frame);)
    there.push_back(frame);
  bole::Options options;
  options.stages.final_pass = false; // live
  options.map.lag = lag_s;
  bole::Pipeline pipeline(source->camera(), source->bMc(), options);
  const std::size_t period = 2 * (there.size() - 1);
  double early = 0, late = 0;
  for (std::size_t i = 0; i < rounds * period; ++i) {
    const std::size_t at = i % period;
    bole::Frame frame = there[std::min(at, period - at)];
    frame.index = i;
    frame.stamp_ns = static_cast<std::int64_t>(i) * 100000000;
    frame.gyro.clear(); // of the way there
    pipeline.process(frame);
    if (i / period == 1 || i / period == 2)
      early += static_cast<double>(live_bytes);
    if (i / period + 2 >= rounds)
      late += static_cast<double>(live_bytes);
  }
  const auto mean_over = static_cast<double>(2 * period);
  return (late - early) / mean_over / static_cast<double>((rounds - 3) * period);
}

TEST(Memory, ALiveFlightKeepsTheGraphOfItsViews)
{
  const double kept = keptAFrame(0, 4);
  RecordProperty("bytes_a_frame", std::to_string(kept));
  EXPECT_LT(kept, 15e3); // 14.1e3 now
  EXPECT_GT(kept, 1e3);  // else nothing was counted
}

TEST(Memory, UnderALagAFlightKeepsItsPathAndALineForEachHypothesis)
{
  const double kept = keptAFrame(5, 7);
  RecordProperty("bytes_a_frame", std::to_string(kept));
  EXPECT_LT(kept, 2e3);
}
} // namespace
