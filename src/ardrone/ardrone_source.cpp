// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/ardrone_source.h>

#include "ardrone/drone_link.h"
#include "geometry/failure.h"
#include "input/frame_builder.h"
#include "input/steady_clock.h"

#include <atomic>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace bole
{
namespace
{
constexpr double kShapeTolerance = 0.01;
constexpr std::int64_t kMotionWait_ns = 1'500'000'000; // longer than clocks and navdata take to settle

/// \p camera for images of \p width x \p height: its own size, or the same shape larger or smaller.
CameraModel fitted(CameraModel camera, int width, int height, const std::string &where)
{
  const double factor = static_cast<double>(width) / camera.pinhole.width;
  if (std::abs(factor * camera.pinhole.height - height) > kShapeTolerance * height)
    throw dimensionError("{}: resolution = {}x{}, must be of the shape of the drone's images, {}x{}", where,
                         camera.pinhole.width, camera.pinhole.height, width, height);
  camera.pinhole = camera.pinhole.scaled(factor);
  camera.pinhole.width = width;
  camera.pinhole.height = height;
  return camera;
}
} // namespace

MountedCamera publishedArDroneCamera(int generation, int width, int height)
{
  MountedCamera camera;
  camera.bMc = forwardCamera();
  if (generation == 1) {
    camera.model.pinhole = {215.1, 215.8, 160.7, 123.3, 320, 240};
    camera.model.distortion = Distortion::fov;
    camera.model.coefficients = {0.272, 0, 0, 0};
  }
  else {
    camera.model.pinhole = {569.9, 568.0, 331.4, 135.9, 640, 360};
    camera.model.distortion = Distortion::radial_tangential;
    camera.model.coefficients = {-0.527, 0.274, 0.0211, -0.0064};
  }
  camera.model = fitted(camera.model, width, height, fmt::format("published camera of the AR.Drone {}", generation));
  return camera;
}

struct ArDroneSource::State
{
  State(const std::string &a, const Options &o, LinkTap tap)
      : address(ArDroneAddress::parse(a)), options(o), grabber(a, o.grabber, std::move(tap))
  {
  }

  ArDroneAddress address;
  Options options;
  vpArDroneGrabber grabber;
  MountedCamera mounted;
  std::unique_ptr<Rectifier> rectifier;
  std::optional<FrameJudge> judge;
  std::atomic<bool> running{true};
  bool first_is_waiting = false; // the frame that the constructor waited for
  std::size_t index = 0;
  std::int64_t last_stamp_ns = std::numeric_limits<std::int64_t>::min(), last_new_ns = 0;
  std::atomic<std::size_t> overtaken{0}; ///< frames of a time that was given out as missing

  void chooseCamera(const vpImage<unsigned char> &first)
  {
    const int width = static_cast<int>(first.getWidth()), height = static_cast<int>(first.getHeight());
    if (address.camera_path.empty()) {
      mounted = publishedArDroneCamera(grabber.getLink().generation(), width, height);
    }
    else {
      mounted = readCamera(address.camera_path, width, height);
      mounted.model = fitted(mounted.model, width, height, address.camera_path);
    }
    rectifier = std::make_unique<Rectifier>(mounted.model, options.max_width_px);
    judge.emplace(mounted.model.pinhole, mounted.bMc);
  }

  /// The first frames have no odometry worth the name: the delays of the link are not known yet.
  void awaitMotion(vpImage<unsigned char> &image)
  {
    const std::int64_t end_ns = steadyNowNs() + kMotionWait_ns;
    const auto is_good = [this] {
      const LiveFrame &live = grabber.getFrame();
      return live.status == FrameStatus::ok && live.body;
    };
    while (!is_good() && steadyNowNs() < end_ns)
      grabber.acquire(image);
    first_is_waiting = grabber.getStatus() == FrameStatus::ok;
  }

  /// The next frame of a later time than what was given out.
  void acquireNewer(vpImage<unsigned char> &image)
  {
    for (grabber.acquire(image); running && grabber.getFrame().stamp_ns <= last_stamp_ns; grabber.acquire(image))
      ++overtaken;
  }

  /// What came off the air as a frame of the pipeline.
  void fill(Frame &frame, vpImage<unsigned char> &image)
  {
    const LiveFrame &live = grabber.getFrame();
    frame = {};
    frame.index = index++;
    frame.status = live.status;
    frame.message = live.message;
    frame.arrival_ns = live.arrival_ns;
    frame.stamp_ns = last_stamp_ns = live.stamp_ns;
    frame.gyro = live.gyro;
    if (live.body)
      frame.wMb_odometry = live.body->wMb;
    if (live.status == FrameStatus::ok || live.status == FrameStatus::stale)
      frame.image = image;
    judge->judge(frame);
    if (frame.image.getSize() > 0 && frame.status != FrameStatus::resized)
      rectifier->apply(frame.image);
  }
};

void ArDroneSource::Options::validate() const
{
  grabber.validate();
  requireRange("give_up_s", give_up_s, 0.5, 86400);
  if (max_width_px != 0 && max_width_px < 64)
    throw badValue("max_width_px = {}, must be 0 or at least 64 px", max_width_px);
}

ArDroneSource::ArDroneSource(const std::string &address) : ArDroneSource(address, Options{}) {}

ArDroneSource::ArDroneSource(const std::string &address, const Options &options, LinkTap tap)
{
  options.validate();
  m_state = std::make_unique<State>(address, options, std::move(tap));
  if (!m_state->address.camera_path.empty())
    readCamera(m_state->address.camera_path); // a fault in the file is said before the drone is waited for
  vpImage<unsigned char> first;
  m_state->grabber.open(first);
  m_state->chooseCamera(first);
  m_state->awaitMotion(first);
  m_state->last_new_ns = steadyNowNs();
}

ArDroneSource::~ArDroneSource() = default;

bool ArDroneSource::accepts(const std::string &address) { return ArDroneAddress::accepts(address); }

bool ArDroneSource::next(Frame &frame)
{
  State &state = *m_state;
  if (!state.running)
    return false;
  vpImage<unsigned char> image;
  if (state.first_is_waiting)
    state.grabber.getFrame().picture.toGrey(image);
  else
    state.acquireNewer(image);
  state.first_is_waiting = false;

  const std::int64_t now_ns = steadyNowNs();
  if (state.grabber.getStatus() != FrameStatus::missing)
    state.last_new_ns = now_ns;
  else if (static_cast<double>(now_ns - state.last_new_ns) * 1e-9 > state.options.give_up_s)
    return false;
  if (!state.running)
    return false;
  state.fill(frame, image);
  return true;
}

PinholeCamera ArDroneSource::camera() const { return m_state->rectifier->camera(); }
Pose ArDroneSource::bMc() const { return m_state->mounted.bMc; }
std::string ArDroneSource::name() const { return m_state->address.toString(); }
void ArDroneSource::stop() noexcept { m_state->running = false; }
LinkCounters ArDroneSource::counters() const
{
  LinkCounters counters = m_state->grabber.getCounters();
  counters.dropped += m_state->overtaken;
  return counters;
}
vpArDroneGrabber &ArDroneSource::grabber() { return m_state->grabber; }
const MountedCamera &ArDroneSource::mountedCamera() const { return m_state->mounted; }
const LiveFrame &ArDroneSource::liveFrame() const { return m_state->grabber.getFrame(); }
} // namespace bole
