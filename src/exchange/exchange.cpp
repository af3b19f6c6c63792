// SPDX-License-Identifier: GPL-2.0-or-later
#include "exchange/exchange.h"

#include "geometry/failure.h"
#include "input/atomic_file.h"
#include "input/regular_file.h"
#include "input/trajectory.h"
#include "mbt/cao_reader.h"
#include "output/summary_json.h"
#include "output/trunks_csv.h"
#include <bole/cylinder.h>
#include <bole/graph.h>

#include <filesystem>

namespace bole
{
const std::vector<ExportFormat> kExportFormats = {
    {"cao", "map.cao", "model for vpMbTrunkTracker and ViSP's own trackers"},
    {"ply", "map.ply", "mesh of the trunks, trajectory as points"},
    {"geojson", "map.geojson", "points with their figures; in degrees with --origin, else in metres"},
    {"dxf", "map.dxf", "circles and labels for CAD (release 12)"},
    {"csv", "trees.csv", "diameters at breast height as foresters list them"},
    {"tum", "smoothed.tum", "trajectory of the body"},
    {"colmap", "colmap", "folder of cameras.txt, images.txt and points3D.txt"},
    {"g2o", "map.g2o", "factor graph"}};

namespace
{
/// Throws where \p folder holds a model of COLMAP's own: its files begin with other words than those of an export.
void requireNoOtherModel(const std::string &folder)
{
  for (const char *name : {"/cameras.txt", "/images.txt", "/points3D.txt"}) {
    if (!std::filesystem::exists(folder + name))
      continue;
    TextLines lines(folder + name);
    lines.next();
    if (lines.line().find("_ID, ") == std::string::npos)
      throw ioError("{}{}: was not written by bole, must not be lost: choose another folder", folder, name);
  }
}
} // namespace

MapOfRun readMapOfRun(const std::string &run)
{
  MapOfRun map;
  map.reference = readReference(run + "/summary.json");
  if (!map.reference.has_ranges)
    throw badValue("{}: the camera only rotated, so that there is no map to be exported", run);
  map.name = std::filesystem::path(run).lexically_normal().filename().string();
  map.camera = readCameraOfRun(run + "/summary.json");
  map.trunks = readTrunks(run + "/trunks.csv");
  map.trajectory = readTumTrajectory(run + "/trajectory.tum");
  map.bMc = readG2o(run + "/graph.g2o").bMc;
  return map;
}

std::string exportRun(const std::string &run, const std::string &format, const std::string &file,
                      const std::optional<GeoOrigin> &origin)
{
  if (format == "g2o") {
    writeG2o(file, readG2o(run + "/graph.g2o"));
    return {};
  }
  const MapOfRun map = readMapOfRun(run);
  if (format == "tum") {
    writeTrajectory(file, map.trajectory);
    return {};
  }
  if (format == "colmap") {
    std::error_code error;
    std::filesystem::create_directories(file, error);
    if (error)
      throw ioError("{}: cannot be made: {}", file, error.message());
    requireNoOtherModel(file);
    const PicturesOfRun pictures = picturesOf(run, map);
    writeAtomically(file + "/cameras.txt", toColmapCamera(pictures.lens));
    writeAtomically(file + "/images.txt", toColmapImages(map, pictures));
    writeAtomically(file + "/points3D.txt", toColmapPoints(map));
    return pictures.note;
  }
  if (map.trunks.empty())
    throw badValue("{}/trunks.csv: no trunk, so that there is no map to be exported", run);
  if (format == "cao") {
    std::vector<Cylinder> cylinders;
    for (const TrunkRecord &trunk : map.trunks)
      cylinders.push_back(cylinderOf(trunk));
    writeCao(file, cylinders, "map of trunks; " + describe(map.reference));
    return {};
  }
  writeAtomically(file, format == "ply"       ? toPly(map)
                        : format == "geojson" ? toGeoJson(map, origin)
                        : format == "dxf"     ? toDxf(map)
                                              : toInventory(map));
  return format == "geojson" && !origin
             ? "coordinates are metres of the run's world, which other programs take for degrees: --origin tells where "
               "it lies"
             : "";
}
} // namespace bole
