// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A picture in a ViSP window, where one was asked for.

#include "command_module.h"

#include <bole/visp.h>
#include <memory>
#include <string>
#include <visp3/core/vpDisplay.h>

namespace bole::apps
{
class OverlayWindow
{
public:
  OverlayWindow(bool is_shown, std::string title) : m_is_shown(is_shown), m_title(std::move(title)) {}
  ~OverlayWindow()
  {
    if (m_display)
      vpDisplay::close(m_picture);
  }
  void show(const vpImage<vpRGBa> &picture)
  {
    if (!m_is_shown || picture.getSize() == 0)
      return;
    m_picture = picture;
    if (!m_display)
      m_display.reset(fromModule<vpDisplay *(vpImage<vpRGBa> &, const std::string &)>(
          "bole_commands.so", "boleMakeWindow")(m_picture, m_title));
    vpDisplay::display(m_picture);
    vpDisplay::flush(m_picture);
  }

private:
  bool m_is_shown;
  std::string m_title;
  vpImage<vpRGBa> m_picture;
  std::unique_ptr<vpDisplay> m_display;
};
} // namespace bole::apps
