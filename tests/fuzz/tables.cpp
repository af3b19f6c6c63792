// SPDX-License-Identifier: GPL-2.0-or-later
// Any bytes as a trajectory (TUM or ASL), as trunks of a map or of a truth, and as the table of a run.
#include "file_of.h"

#include "input/trajectory.h"
#include "output/trunks_csv.h"
#include <bole/open_source.h>

#include <visp3/core/vpException.h>

namespace
{
template <typename Read> void attempt(const std::string &path, const Read &read)
{
  try {
    read();
  }
  catch (const vpException &error) {
    bole::fuzz::requireNamed(error.getStringMessage(), path);
  }
}
} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size)
{
  const std::string path = bole::fuzz::fileOf(data, size, "trees.csv");
  attempt(path, [&] {
    const bole::Trajectory trajectory = bole::readTrajectory(path);
    for (std::size_t i = 0; i < trajectory.size(); ++i)
      if (!trajectory[i].wMb.isFinite() || (i > 0 && trajectory[i].stamp_ns <= trajectory[i - 1].stamp_ns))
        std::abort();
    bole::interpolate(trajectory, (trajectory.front().stamp_ns + trajectory.back().stamp_ns) / 2);
  });
  attempt(path, [&] { bole::readTruthTrunks(path.substr(0, path.rfind('/'))); });
  attempt(path, [&] { bole::readTrunks(path); });
  return 0;
}
