// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/live_video.h"
#include "geometry/failure.h"
#include "input/recorded_source.h"
#include "input/steady_clock.h"
#include "input/user_text.h"

#include <bole/visp.h>
#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>
#include <visp3/core/vpException.h>
#include <visp3/sensor/vpV4l2Grabber.h>

namespace bole
{
namespace
{
constexpr char kDevice[] = "/dev/video";
constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kFrameTimeout_ns = kSecond_ns / 2; ///< without a picture there is a missing frame
constexpr std::int64_t kShortest_ns = kSecond_ns / 1000;  ///< between the last picture of a connection and the next
constexpr double kRetry_s = 0.5, kLongestRetry_s = 2;     ///< between two attempts to connect

bool isDevice(const std::string &address) { return address.rfind(kDevice, 0) == 0; }

/// The next picture; false at the end of the connection. Throws vpException for what went wrong.
using PictureReader = std::function<bool(Picture &)>;

PictureReader readerOf(std::unique_ptr<VideoFile> file)
{
  return [shared = std::shared_ptr<VideoFile>(std::move(file))](Picture &picture) { return shared->next(picture); };
}

PictureReader openCamera(const std::string &device)
{
#ifdef VISP_HAVE_V4L2
  if (!std::filesystem::exists(device))
    throw ioError("{}: no camera: there is no such device", device);
  auto grabber = std::make_shared<vpV4l2Grabber>();
  grabber->setDevice(device);
  grabber->setScale(1);
  vpImage<unsigned char> image;
  try {
    grabber->open(image);
  }
  catch (const vpException &error) {
    throw ioError("{}: no camera: {}", device, error.getStringMessage());
  }
  return [grabber, first_ns = std::int64_t(-1)](Picture &picture) mutable {
    timeval stamp{};
    grabber->acquire(picture.image, stamp);
    const std::int64_t stamp_ns = stamp.tv_sec * kSecond_ns + stamp.tv_usec * 1000;
    if (first_ns < 0)
      first_ns = stamp_ns;
    picture.stamp_ns = stamp_ns - first_ns;
    picture.clock = stamp_ns;
    return true;
  };
#else
  throw notImplementedError("{}: this ViSP was built without V4L2, no camera can be read", device);
#endif
}

PictureReader openReader(const std::string &address, const std::shared_ptr<ReadLimit> &limit)
{
  return isDevice(address) ? openCamera(address) : readerOf(std::make_unique<VideoFile>(address, limit));
}
} // namespace

struct LiveVideoSource::State
{
  std::string address, name; ///< to be opened; to be shown
  std::int64_t give_up_ns = 0;
  std::shared_ptr<ReadLimit> limit = std::make_shared<ReadLimit>();
  PictureReader reader;
  std::int64_t begun_ns = 0; ///< when the first picture came: where stamps count from
  Picture beginning;         ///< the first picture of the first connection

  std::mutex mutex;
  std::condition_variable changed;
  std::optional<Picture> newest;
  std::int64_t arrival_ns = 0;
  std::string trouble; ///< why nothing comes
  Counters counters;
  bool is_stopped = false;
  bool is_over = false; ///< nothing comes after `newest`
  std::thread thread;

  std::int64_t last_stamp_ns = -1;           ///< given out
  std::int64_t picture_ns = 0, heard_ns = 0; ///< stamp of the newest picture, and when it came

  ~State()
  {
    stop();
    if (thread.joinable())
      thread.join();
  }

  void stop() noexcept
  {
    limit->is_stopped = true;
    const std::lock_guard<std::mutex> lock(mutex);
    is_stopped = true;
    changed.notify_all();
  }

  /// A whole picture, which tells the size.
  Picture first()
  {
    constexpr int kMostDamaged = 300; // until a key frame comes
    Picture picture;
    for (int i = 0; i < kMostDamaged && reader(picture); ++i)
      if (!picture.is_damaged)
        return picture;
    throw ioError("{}: no picture that can be decoded", name);
  }

  /// Takes every picture, and connects again when none comes any more. What begins again with the very same picture at
  /// the same time was no camera but a file without a length: it is over.
  void read(std::int64_t offset_ns)
  {
    bool is_first = false, is_again = false; // of a connection
    RetryPause pause(kRetry_s, kLongestRetry_s);
    std::int64_t connected_ns = steadyNowNs(), last_ns = 0;
    while (!limit->is_stopped) {
      try {
        if (!reader) {
          reader = openReader(address, limit);
          is_first = is_again = true;
          connected_ns = steadyNowNs();
          const std::lock_guard<std::mutex> lock(mutex);
          ++counters.connections;
        }
        Picture picture;
        if (!reader(picture))
          throw ioError("{}: the stream ended", name);
        const std::int64_t arrived_ns = steadyNowNs();
        if (is_again && picture.clock == beginning.clock && picture.image == beginning.image)
          return end();
        if (std::exchange(is_first, false))
          offset_ns = std::max(arrived_ns - begun_ns, last_ns + kShortest_ns) - picture.stamp_ns;
        picture.stamp_ns += offset_ns;
        last_ns = picture.stamp_ns;
        take(std::move(picture), arrived_ns);
      }
      catch (const vpException &error) {
        reader = nullptr;
        if (steadyNowNs() - connected_ns > kSecond_ns)
          pause.reset();
        std::unique_lock<std::mutex> lock(mutex);
        trouble = error.getStringMessage();
        changed.wait_for(lock, pause.next(), [this] { return is_stopped; });
      }
    }
  }

  /// Whether there is a picture of a later time than what was given out; others are dropped.
  bool hasNewer()
  {
    if (!newest)
      return false;
    picture_ns = newest->stamp_ns;
    heard_ns = arrival_ns;
    if (picture_ns > last_stamp_ns)
      return true;
    ++counters.dropped;
    newest.reset();
    return false;
  }

  void end()
  {
    const std::lock_guard<std::mutex> lock(mutex);
    is_over = true;
    changed.notify_all();
  }

  void take(Picture picture, std::int64_t arrived_ns)
  {
    const std::lock_guard<std::mutex> lock(mutex);
    ++counters.pictures;
    counters.dropped += newest.has_value();
    if (newest && picture.is_damaged && !newest->is_damaged)
      return;
    newest = std::move(picture);
    arrival_ns = arrived_ns;
    trouble.clear();
    changed.notify_all();
  }
};

bool LiveVideoSource::accepts(const std::string &address)
{
  std::error_code error;
  return isDevice(address) || (address.find("://") != std::string::npos && address.rfind("ardrone:", 0) != 0 &&
                               !std::filesystem::exists(address, error));
}

LiveVideoSource::LiveVideoSource(const std::string &address, const SourceOptions &options, double give_up_s,
                                 std::unique_ptr<VideoFile> file)
{
  requireUsed(options, withoutSecrets(address), kStream);
  if (!(give_up_s > 0 && give_up_s <= 86400))
    throw badValue("give_up_s = {:g}, must be in (0, 86400]", give_up_s);
  m_name = withoutSecrets(address);
  m_state = std::make_unique<State>();
  State &state = *m_state;
  state.address = address;
  state.name = m_name;
  state.give_up_ns = static_cast<std::int64_t>(give_up_s * 1e9);
  if (file)
    state.limit = file->limit();
  const double pixel_aspect = file ? file->pixelAspect() : 1;
  state.reader = file ? readerOf(std::move(file)) : openReader(address, state.limit);
  state.counters.connections = 1;
  Picture first = state.first();
  state.beginning = first;
  const std::int64_t first_ns = first.stamp_ns;
  first.stamp_ns = 0;
  const MountedCamera camera = cameraFor(options, static_cast<int>(first.image.getWidth()),
                                         static_cast<int>(first.image.getHeight()), m_note, pixel_aspect);
  m_builder = std::make_unique<FrameBuilder>(camera, options, Recording());
  state.begun_ns = state.heard_ns = steadyNowNs();
  state.take(std::move(first), state.begun_ns);
  state.thread = std::thread([&state, first_ns] { state.read(-first_ns); });
}

LiveVideoSource::~LiveVideoSource() = default;

bool LiveVideoSource::next(Frame &frame)
{
  State &state = *m_state;
  ImageFile file;
  std::int64_t stamp_ns = 0, arrival_ns = 0;
  {
    std::unique_lock<std::mutex> lock(state.mutex);
    const auto end = std::chrono::steady_clock::now() + std::chrono::nanoseconds(kFrameTimeout_ns);
    state.changed.wait_until(lock, end, [&state] { return state.hasNewer() || state.is_stopped || state.is_over; });
    if (state.is_stopped || (state.is_over && !state.newest))
      return false;
    if (state.newest) {
      stamp_ns = state.picture_ns;
      arrival_ns = state.heard_ns;
      file.status = state.newest->is_damaged ? FrameStatus::corrupt : FrameStatus::ok;
      file.message = std::move(state.newest->message);
      file.image = std::move(state.newest->image);
      state.newest.reset();
    }
    else {
      const std::int64_t now = steadyNowNs();
      if (now - state.heard_ns > state.give_up_ns)
        return false;
      // By the clock of the stream; half a timeout early, so that the picture that comes next is not before.
      stamp_ns = std::max(state.picture_ns + now - state.heard_ns, state.last_stamp_ns + kFrameTimeout_ns) -
                 kFrameTimeout_ns / 2;
      file.status = FrameStatus::missing;
      file.message = !state.trouble.empty()                    ? state.trouble
                     : now - state.heard_ns < kFrameTimeout_ns ? "the stamps of its pictures do not advance"
                                                               : "no picture came";
    }
  }
  state.last_stamp_ns = stamp_ns;
  m_builder->build(stamp_ns, std::move(file), frame);
  frame.arrival_ns = arrival_ns;
  return true;
}

LiveVideoSource::Counters LiveVideoSource::counters() const
{
  const std::lock_guard<std::mutex> lock(m_state->mutex);
  return m_state->counters;
}

void LiveVideoSource::stop() noexcept { m_state->stop(); }

std::unique_ptr<FrameSource> openStream(const std::string &address, const SourceOptions &options, double give_up_s)
{
  if (isDevice(address))
    return std::make_unique<LiveVideoSource>(address, options, give_up_s);
  auto file = std::make_unique<VideoFile>(address, std::make_shared<ReadLimit>());
  if (file->isLive())
    return std::make_unique<LiveVideoSource>(address, options, give_up_s, std::move(file));
  return std::make_unique<VideoSource>(address, options, std::move(file));
}
} // namespace bole
