// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/vpArDroneGrabber.h>

#include "ardrone/drone_link.h"
#include "geometry/failure.h"
#include "input/steady_clock.h"

#include <algorithm>
#include <fmt/format.h>

void vpArDroneGrabber::Options::validate() const
{
  bole::requireRange("open_timeout_s", open_timeout_s, 0.1, 600);
  bole::requireRange("frame_timeout_s", frame_timeout_s, 0.02, 60);
}

struct vpArDroneGrabber::State
{
  bole::ArDroneAddress address;
  Options options;
  bole::LinkTap tap;
  std::unique_ptr<bole::DroneLink> link;
  bole::LiveFrame frame;
  struct Instant
  {
    std::int64_t stamp_ns = 0, arrival_ns = 0;
  };
  Instant last_whole; ///< of the frame before those that are missing
};

vpArDroneGrabber::vpArDroneGrabber(const std::string &address) : vpArDroneGrabber(address, Options{}) {}

vpArDroneGrabber::vpArDroneGrabber(const std::string &address, const Options &options, bole::LinkTap tap)
    : m_state(std::make_unique<State>())
{
  options.validate();
  m_state->address = bole::ArDroneAddress::parse(address);
  m_state->options = options;
  m_state->tap = std::move(tap);
}

vpArDroneGrabber::~vpArDroneGrabber() = default;

bole::FrameStatus vpArDroneGrabber::getStatus() const { return m_state->frame.status; }
const std::string &vpArDroneGrabber::getMessage() const { return m_state->frame.message; }
double vpArDroneGrabber::getTimestamp() const { return static_cast<double>(m_state->frame.stamp_ns) * 1e-9; }
std::uint32_t vpArDroneGrabber::getFrameNumber() const { return m_state->frame.number; }
const std::optional<bole::BodyState> &vpArDroneGrabber::getBody() const { return m_state->frame.body; }
const bole::LiveFrame &vpArDroneGrabber::getFrame() const { return m_state->frame; }

void vpArDroneGrabber::connect()
{
  if (!m_state->link)
    m_state->link = std::make_unique<bole::DroneLink>(m_state->address, m_state->tap);
}

void vpArDroneGrabber::waitForFirstImage()
{
  close();
  connect();
  const std::int64_t end_ns = bole::steadyNowNs() + static_cast<std::int64_t>(m_state->options.open_timeout_s * 1e9);
  std::string why; // the last image was no whole one
  do {
    if (!m_state->link->next(m_state->frame, 0.05))
      continue;
    why = m_state->frame.message;
    if (m_state->frame.status == bole::FrameStatus::ok) {
      width = static_cast<unsigned>(m_state->frame.picture.width);
      height = static_cast<unsigned>(m_state->frame.picture.height);
      init = true;
      return;
    }
  } while (bole::steadyNowNs() < end_ns);
  const bool answered = m_state->link->counters().connections > 0;
  close();
  throw bole::ioError("{}: {} within {} s{}{}", m_state->address.toString(),
                      answered ? "no whole image" : "no drone answers", m_state->options.open_timeout_s,
                      why.empty() ? "" : ": ", why);
}

void vpArDroneGrabber::open(vpImage<unsigned char> &I)
{
  waitForFirstImage();
  m_state->frame.picture.toGrey(I);
}

void vpArDroneGrabber::open(vpImage<vpRGBa> &I)
{
  waitForFirstImage();
  m_state->frame.picture.toColour(I);
}

void vpArDroneGrabber::grab()
{
  bole::LiveFrame frame;
  const bole::LiveFrame last = std::move(m_state->frame);
  if (!getLink().next(frame, m_state->options.frame_timeout_s)) {
    if (last.status != bole::FrameStatus::missing)
      m_state->last_whole = {last.stamp_ns, last.arrival_ns};
    const std::int64_t waited_ns = bole::steadyNowNs() - m_state->last_whole.arrival_ns;
    frame.status = bole::FrameStatus::missing;
    frame.message = fmt::format("no image for {:.1f} s", static_cast<double>(waited_ns) * 1e-9);
    frame.number = last.number;
    frame.arrival_ns = last.arrival_ns;
    // On the drone's clock; half a timeout early, so that the frame that comes next is not before.
    frame.stamp_ns = std::max(last.stamp_ns + 1, m_state->last_whole.stamp_ns + waited_ns -
                                                     static_cast<std::int64_t>(m_state->options.frame_timeout_s * 5e8));
    m_state->link->addMotion(frame);
  }
  m_state->frame = std::move(frame);
}

void vpArDroneGrabber::acquire(vpImage<unsigned char> &I)
{
  grab();
  if (m_state->frame.status == bole::FrameStatus::ok || m_state->frame.status == bole::FrameStatus::stale)
    m_state->frame.picture.toGrey(I);
}

void vpArDroneGrabber::acquire(vpImage<vpRGBa> &I)
{
  grab();
  if (m_state->frame.status == bole::FrameStatus::ok || m_state->frame.status == bole::FrameStatus::stale)
    m_state->frame.picture.toColour(I);
}

void vpArDroneGrabber::close()
{
  m_state->link.reset();
  m_state->frame = {};
  init = false;
}

bole::LinkCounters vpArDroneGrabber::getCounters() const
{
  return m_state->link ? m_state->link->counters() : bole::LinkCounters{};
}

bole::DroneLink &vpArDroneGrabber::getLink()
{
  if (!m_state->link)
    throw bole::notInitialized("the grabber is not open: call open() or connect() first");
  return *m_state->link;
}
