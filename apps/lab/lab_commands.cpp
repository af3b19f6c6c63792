// SPDX-License-Identifier: GPL-2.0-or-later
// What `bole` loads of the laboratory: see command_module.h.
#include "lab_commands.h"

extern "C" void boleAddCommands(CLI::App &app)
{
  using namespace bole::apps;
  addCompare(app);
  addSimulate(app);
  addServo(app);
  addReplay(app);
  addEmulate(app);
  addShowSaliency(app);
  addReproduce(app);
  addFitOdds(app);
}
