// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/run_folder.h"

#include "input/atomic_file.h"
#include "output/trajectory_writer.h"
#include "output/trunks_csv.h"

namespace bole
{
const FileNames RunFolder::kFiles = {
    "summary.json", "trajectory.tum", "trajectory_online.tum", "trunks.csv",  "hypotheses.csv", "bearings.csv",
    "map.svg",      "timing.csv",     "options.yaml",          "graph.g2o",   "frames.csv",     "views.csv",
    "evidence.csv", "overlay.mp4",    "saliency.mp4",          "views/*.jpg", "report.html"};

void RunFolder::write(const MapPicture &picture, const RunSummary &summary, const Eigen::Vector2d &camera) const
{
  writeTrajectory(file("trajectory.tum"), picture.smoothed);
  writeTrajectory(file("trajectory_online.tum"), picture.online);
  const bool has_ranges = summary.reference.has_ranges;
  writeTrunks(file("trunks.csv"), has_ranges ? summary.trunks : std::vector<TrunkRecord>());
  writeHypotheses(file("hypotheses.csv"), has_ranges ? summary.trunks : std::vector<TrunkRecord>());
  if (has_ranges)
    removeFiles(path(), {"bearings.csv"});
  else
    writeBearings(file("bearings.csv"), summary.trunks, camera);
  writeMap(file("map.svg"), picture);
  writeTiming(file("timing.csv"), summary.timing);
  writeAtomically(file("options.yaml"), summary.options);
  writeSummary(file("summary.json"), summary);
}
} // namespace bole
