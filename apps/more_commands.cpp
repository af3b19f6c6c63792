// SPDX-License-Identifier: GPL-2.0-or-later
// What command_module.h gives.
#include "commands.h"

#include <bole/visp.h>
#include <visp3/gui/vpDisplayX.h>

extern "C" void boleAddCommands(CLI::App &app) { bole::apps::addFollow(app); }

extern "C" vpDisplay *boleMakeWindow(vpImage<vpRGBa> &picture, const std::string &title)
{
  return new vpDisplayX(picture, 100, 100, title);
}
