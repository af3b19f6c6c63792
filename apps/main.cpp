// SPDX-License-Identifier: GPL-2.0-or-later
// The command `bole`: one subcommand a file, see commands.h.
#include "commands.h"

#include "version.h"

#include <cstdio>
#include <opencv2/core/version.hpp>
#include <string>
#include <visp3/core/vpConfig.h>
#include <visp3/core/vpException.h>

namespace
{
/// "bole 0.1.0 (9720183abc), ViSP 3.5.0, OpenCV 4.6.0"
std::string versions()
{
  const std::string commit = BOLE_COMMIT;
  return "bole " BOLE_VERSION + (commit.empty() ? "" : " (" + commit + ")") + ", ViSP " +
         std::to_string(VISP_VERSION_MAJOR) + "." + std::to_string(VISP_VERSION_MINOR) + "." +
         std::to_string(VISP_VERSION_PATCH) + ", OpenCV " CV_VERSION;
}
} // namespace

int main(int argc, char **argv)
{
  CLI::App app("bole: tree trunks as vertical cylinders, tracked and mapped from a small drone's video", "bole");
  app.set_version_flag("--version", versions());
  app.require_subcommand(1);
  bole::apps::addTrack(app);
  bole::apps::addEvaluate(app);
  bole::apps::addOptions(app);
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
  bole::apps::addDocumentation(app, "bole " BOLE_VERSION);
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
