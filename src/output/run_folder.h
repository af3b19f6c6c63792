// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The folder of a run: the only place that writes into it.

#include "output/map_svg.h"
#include "output/summary_json.h"
#include <bole/output_folder.h>

#include <string>

namespace bole
{
/// Every file is either the old one or the complete new one (AtomicFile).
class RunFolder : public OutputFolder
{
public:
  /// What `bole track` writes, summary.json first.
  static const FileNames kFiles;

  explicit RunFolder(std::string path) : OutputFolder(std::move(path), kFiles) {}

  /// Trajectories, trunks, hypotheses, map, timing, options and summary. Where no range is known (summary.reference)
  /// trunks.csv has no rows, and bearings.csv holds what the camera saw; \p camera: its place in the map.
  void write(const MapPicture &picture, const RunSummary &summary, const Eigen::Vector2d &camera) const;
};
} // namespace bole
