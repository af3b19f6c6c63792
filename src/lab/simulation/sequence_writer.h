// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Writes a flight as an ASL folder (the layout of EuRoC), with the truth beside it.

#include "simulation/forest_renderer.h"
#include <bole/frame.h>

#include <cstdint>
#include <fstream>
#include <string>

namespace bole
{
/// The folder appears under its name only when finish() has written everything; until then, and
/// after an interruption, it is beside it as `<folder>.partial`.
///
/// Layout: mav0/cam0/{sensor.yaml,data.csv,data/<stamp>.png}, mav0/imu0/data.csv,
/// mav0/odom0/data.csv, mav0/state_groundtruth_estimate0/data.csv, trees.csv, trees_far.csv; with truth images
/// depth/<stamp>.png (16-bit, millimetres along the optical axis, rounded to 20 mm below 10 m and 100 mm beyond, 65535
/// = sky or beyond 65 m) and trunk_id/<stamp>.png (16-bit, id of the trunk, 65535 = none).
class SequenceWriter
{
public:
  /// Throws vpException where \p folder exists, unless \p overwrite, or cannot be made.
  SequenceWriter(const std::string &folder, const CameraModel &camera, const Pose &bMc, double rate_hz,
                 bool overwrite = false);

  void writeFrame(std::int64_t stamp_ns, const RenderedFrame &frame, const Pose &wMb_truth, const Pose &wMb_odometry);
  void writeImu(const GyroSample &sample);
  void writeForest(const Forest &forest);
  /// Any other small text file, e.g. the scene: name relative to the folder.
  void writeText(const std::string &name, const std::string &text);
  /// Closes the files and gives the folder its name.
  void finish();

private:
  std::string path(const std::string &name) const { return m_partial + "/" + name; }

  std::string m_folder, m_partial;
  bool m_overwrite;
  std::ofstream m_images, m_imu, m_odometry, m_truth;
};
} // namespace bole
