// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Maps and trajectories for other tools, from what the folder of a run holds.

#include "input/trajectory.h"
#include <bole/camera.h>
#include <bole/trunk_record.h>

#include <map>
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

/// The pictures that a run was made of, as they lie on the disk.
struct PicturesOfRun
{
  CameraModel lens;                          ///< that they were taken with
  std::map<std::int64_t, std::string> names; ///< by their stamps [ns]
  std::string note;                          ///< what a user has to know of them
};
/// Where the input of \p run is not there any more: the rectified camera of \p map, and names made of the stamps.
PicturesOfRun picturesOf(const std::string &run, const MapOfRun &map);

// The formats as text; each is read back by an independent reader in a test.
std::string toPly(const MapOfRun &map); ///< ASCII: a mesh of the trunks, the trajectory as points
/// Points of the trunks with their figures and a line of the trajectory: in degrees where \p origin tells how, else in
/// metres of the world, which the file says.
std::string toGeoJson(const MapOfRun &map, const std::optional<GeoOrigin> &origin);
std::string toDxf(const MapOfRun &map);       ///< release 12: circles and ids of the trunks, the trajectory
std::string toInventory(const MapOfRun &map); ///< a line a tree: place, diameter at breast height, basal area, lean
std::string toColmapCamera(const CameraModel &lens);
std::string toColmapImages(const MapOfRun &map, const PicturesOfRun &pictures);
std::string toColmapPoints(const MapOfRun &map); ///< on the surfaces of the trunks

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
