// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/vpArDroneGrabber.h>

#include "socket.h"

#include <fmt/format.h>
#include <visp3/core/vpException.h>

void vpArDroneGrabber::Options::validate() const
{
  if (!(open_timeout_s > 0.1 && open_timeout_s < 600))
    throw vpException(vpException::badValue, "open_timeout_s = %g, must be in (0.1, 600) s",
                      open_timeout_s);
  if (!(frame_timeout_s > 0.02 && frame_timeout_s < 60))
    throw vpException(vpException::badValue, "frame_timeout_s = %g, must be in (0.02, 60) s",
                      frame_timeout_s);
  link.validate();
}

vpArDroneGrabber::vpArDroneGrabber(const std::string &address)
    : vpArDroneGrabber(bole::ArDroneAddress::parse(address), Options{})
{
}

vpArDroneGrabber::vpArDroneGrabber(const bole::ArDroneAddress &address, const Options &options,
                                   bole::LinkTap tap)
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
  const std::int64_t end_ns =
      bole::steadyNowNs() + static_cast<std::int64_t>(m_options.open_timeout_s * 1e9);
  do {
    if (m_link->next(m_frame, 0.05) && m_frame.status == bole::FrameStatus::ok) {
      width = static_cast<unsigned>(m_frame.picture.width);
      height = static_cast<unsigned>(m_frame.picture.height);
      init = true;
      return;
    }
  } while (bole::steadyNowNs() < end_ns);
  const bool answered = m_link->counters().connections > 0;
  close();
  throw vpException(vpException::ioError,
                    fmt::format("{}: {} within {} s", m_address.toString(),
                                answered ? "no whole image" : "no drone answers",
                                m_options.open_timeout_s));
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
    const double waited_s = static_cast<double>(bole::steadyNowNs() - last.arrival_ns) * 1e-9;
    frame.status = bole::FrameStatus::missing;
    frame.message = fmt::format("no image for {:.1f} s", waited_s);
    frame.number = last.number;
    frame.stamp_ns = last.stamp_ns;
    frame.arrival_ns = last.arrival_ns;
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

bole::LinkCounters vpArDroneGrabber::getCounters() const
{
  return m_link ? m_link->counters() : bole::LinkCounters{};
}

bole::DroneLink &vpArDroneGrabber::getLink()
{
  if (!m_link)
    throw vpException(vpException::notInitialized,
                      "the grabber is not open: call open() or connect() first");
  return *m_link;
}
