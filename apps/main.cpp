// SPDX-License-Identifier: GPL-2.0-or-later
// The command `bole`: one subcommand a file, see commands.h.
#include "commands.h"

#include <cstdio>
#include <visp3/core/vpException.h>

int main(int argc, char **argv)
{
  CLI::App app("bole: tree trunks as vertical cylinders, tracked and mapped from a small drone's video", "bole");
  app.set_version_flag("--version", "bole " BOLE_VERSION);
  app.require_subcommand(1);
  bole::apps::addTrack(app);
  bole::apps::addEvaluate(app);
  bole::apps::addRecord(app);
  bole::apps::addGraph(app);
  bole::apps::addSolve(app);
#ifdef BOLE_LAB
  bole::apps::addCompare(app);
  bole::apps::addSimulate(app);
  bole::apps::addServo(app);
  bole::apps::addBenchmark(app);
  bole::apps::addReplay(app);
  bole::apps::addEmulate(app);
  bole::apps::addCalibrateSaliency(app);
  bole::apps::addShowSaliency(app);
#endif
  try {
    app.parse(argc, argv);
  }
  catch (const CLI::ParseError &error) {
    return app.exit(error);
  }
  catch (const vpException &error) {
    std::fprintf(stderr, "bole: %s\n", error.what());
    return 1;
  }
  catch (const std::exception &error) {
    std::fprintf(stderr, "bole: %s\n", error.what());
    return 1;
  }
  return 0;
}
