// SPDX-License-Identifier: GPL-2.0-or-later
// What command_module.h gives.
#include "commands.h"

#include <bole/visp.h>
#include <visp3/gui/vpDisplayX.h>

extern "C" void boleAddMoreCommands(CLI::App &app)
{
  using namespace bole::apps;
  addFollow(app);
#ifdef BOLE_LAB
  addCompare(app);
  addSimulate(app);
  addServo(app);
  addReplay(app);
  addEmulate(app);
  addShowSaliency(app);
  addReproduce(app);
  addFitOdds(app);
#endif
}

extern "C" vpDisplay *boleMakeWindow(vpImage<vpRGBa> &picture, const std::string &title)
{
  return new vpDisplayX(picture, 100, 100, title);
}
