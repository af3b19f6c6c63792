// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The folder of a run: the only place that writes into it.

#include "output/map_svg.h"
#include "output/summary_json.h"

#include <string>

namespace bole
{
/// Makes the folder, holds it for this process, and clears what a process that was killed left half written.
///
/// Every file is either the old one or the complete new one (AtomicFile). Errors: vpException naming the folder where
/// it cannot be made or another process writes into it.
class RunFolder
{
public:
  explicit RunFolder(std::string path);
  ~RunFolder();
  RunFolder(const RunFolder &) = delete;
  RunFolder &operator=(const RunFolder &) = delete;

  const std::string &path() const { return m_path; }
  std::string file(const std::string &name) const { return m_path + "/" + name; }

  /// Trajectories, trunks, hypotheses, map, timing, options and summary. Where no range is known (summary.reference)
  /// trunks.csv has no rows, and bearings.csv holds what the camera saw; \p camera: its place in the map.
  void write(const MapPicture &picture, const RunSummary &summary, const Eigen::Vector2d &camera) const;

private:
  std::string m_path;
  int m_lock = -1;
};
} // namespace bole
