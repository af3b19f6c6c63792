// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Maps and trajectories for other tools, from what the folder of a run holds.

#include <bole/camera.h>
#include <bole/trunk_record.h>

#include <optional>
#include <string>
#include <vector>

namespace bole
{
/// Where the origin of the world lies on the earth.
struct GeoOrigin
{
  double latitude = 0, longitude = 0; ///< of the origin, WGS 84 [degrees]
  double heading = 0;                 ///< of the world's x axis, clockwise from true north [degrees]
};

/// "59.3,18.1,270". \throw vpException that tells the value and what is allowed.
GeoOrigin parseOrigin(const std::string &text);

/// Longitude and latitude [degrees] of the point \p xy [m] of the world. The earth is taken for a plane that touches
/// WGS 84 at the origin: off by 1 cm at 350 m, by 10 cm at 1.1 km (at 60 degrees of latitude).
Eigen::Vector2d toEarth(const GeoOrigin &origin, const Eigen::Vector2d &xy);

/// What is exported.
struct MapOfRun
{
  std::string name;
  std::vector<TrunkRecord> trunks; ///< the confirmed ones
  Trajectory trajectory;           ///< smoothed
  WorldReference reference;
  PinholeCamera camera;
  Pose bMc;
};
/// \throw vpException naming the file of \p run that is missing or faulty, or when the run knows no ranges.
MapOfRun readMapOfRun(const std::string &run);

/// A format by the name that `bole export` takes.
struct ExportFormat
{
  const char *name, *file, *what; ///< file: default name in the folder of the run
};
extern const std::vector<ExportFormat> kExportFormats;

/// Writes what \p run holds to \p file (for colmap a folder). Files are complete or not there.
/// \return what the user has to know of them, empty where nothing
/// \throw vpException naming what is missing, faulty or cannot be written.
std::string exportRun(const std::string &run, const std::string &format, const std::string &file,
                      const std::optional<GeoOrigin> &origin);
} // namespace bole
