// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/vpArDroneGrabber.h>

#include "ardrone/socket.h"

#include <algorithm>
#include <fmt/format.h>
#include <visp3/core/vpException.h>

void vpArDroneGrabber::Options::validate() const
{
  if (!(open_timeout_s > 0.1 && open_timeout_s < 600))
    throw vpException(vpException::badValue, "open_timeout_s = %g, must be in (0.1, 600) s", open_timeout_s);
  if (!(frame_timeout_s > 0.02 && frame_timeout_s < 60))
    throw vpException(vpException::badValue, "frame_timeout_s = %g, must be in (0.02, 60) s", frame_timeout_s);
  link.validate();
}

vpArDroneGrabber::vpArDroneGrabber(const std::string &address)
    : vpArDroneGrabber(bole::ArDroneAddress::parse(address), Options{})
{
}

vpArDroneGrabber::vpArDroneGrabber(const bole::ArDroneAddress &address, const Options &options, bole::LinkTap tap)
    : m_address(address), m_options(options), m_tap(std::move(tap))
{
  m_options.validate();
}

vpArDroneGrabber::~vpArDroneGrabber() = default;

void vpArDroneGrabber::connect()
{
  if (!m_link)
    m_link = std::make_unique<bole::DroneLink>(m_address, m_options.link, m_tap);
}

void vpArDroneGrabber::waitForFirstImage()
{
  close();
  connect();
  const std::int64_t end_ns = bole::steadyNowNs() + static_cast<std::int64_t>(m_options.open_timeout_s * 1e9);
  std::string why; // the last image was no whole one
  do {
    if (!m_link->next(m_frame, 0.05))
      continue;
    why = m_frame.message;
    if (m_frame.status == bole::FrameStatus::ok) {
      width = static_cast<unsigned>(m_frame.picture.width);
      height = static_cast<unsigned>(m_frame.picture.height);
      init = true;
      return;
    }
  } while (bole::steadyNowNs() < end_ns);
  const bool answered = m_link->counters().connections > 0;
  close();
  throw vpException(vpException::ioError, fmt::format("{}: {} within {} s{}{}", m_address.toString(),
                                                      answered ? "no whole image" : "no drone answers",
                                                      m_options.open_timeout_s, why.empty() ? "" : ": ", why));
}

void vpArDroneGrabber::open(vpImage<unsigned char> &I)
{
  waitForFirstImage();
  m_frame.picture.toGrey(I);
}

void vpArDroneGrabber::open(vpImage<vpRGBa> &I)
{
  waitForFirstImage();
  m_frame.picture.toColour(I);
}

void vpArDroneGrabber::grab()
{
  bole::LiveFrame frame;
  const bole::LiveFrame last = std::move(m_frame);
  if (!getLink().next(frame, m_options.frame_timeout_s)) {
    if (last.status != bole::FrameStatus::missing)
      m_last_whole = {last.stamp_ns, last.arrival_ns};
    const std::int64_t waited_ns = bole::steadyNowNs() - m_last_whole.arrival_ns;
    frame.status = bole::FrameStatus::missing;
    frame.message = fmt::format("no image for {:.1f} s", static_cast<double>(waited_ns) * 1e-9);
    frame.number = last.number;
    frame.arrival_ns = last.arrival_ns;
    // On the drone's clock; half a timeout early, so that the frame that comes next is not before.
    frame.stamp_ns = std::max(last.stamp_ns + 1, m_last_whole.stamp_ns + waited_ns -
                                                     static_cast<std::int64_t>(m_options.frame_timeout_s * 5e8));
    m_link->addMotion(frame);
  }
  m_frame = std::move(frame);
}

void vpArDroneGrabber::acquire(vpImage<unsigned char> &I)
{
  grab();
  if (m_frame.status == bole::FrameStatus::ok || m_frame.status == bole::FrameStatus::stale)
    m_frame.picture.toGrey(I);
}

void vpArDroneGrabber::acquire(vpImage<vpRGBa> &I)
{
  grab();
  if (m_frame.status == bole::FrameStatus::ok || m_frame.status == bole::FrameStatus::stale)
    m_frame.picture.toColour(I);
}

void vpArDroneGrabber::close()
{
  m_link.reset();
  m_frame = {};
  init = false;
}

bole::LinkCounters vpArDroneGrabber::getCounters() const { return m_link ? m_link->counters() : bole::LinkCounters{}; }

bole::DroneLink &vpArDroneGrabber::getLink()
{
  if (!m_link)
    throw vpException(vpException::notInitialized, "the grabber is not open: call open() or connect() first");
  return *m_link;
}
