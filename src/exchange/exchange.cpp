// SPDX-License-Identifier: GPL-2.0-or-later
#include "exchange/exchange.h"

#include "geometry/constants.h"
#include "geometry/failure.h"
#include "geometry/parse_number.h"
#include "input/atomic_file.h"
#include "input/recorded_source.h"
#include "input/regular_file.h"
#include "input/trajectory.h"
#include "output/flight_trace.h"
#include "output/summary_json.h"
#include "output/trunks_csv.h"
#include <bole/cylinder.h>
#include <bole/graph.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

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

GeoOrigin parseOrigin(const std::string &text)
{
  std::vector<double> numbers;
  std::istringstream stream(text);
  for (std::string word; std::getline(stream >> std::ws, word, ',');)
    if (const auto number = parseNumber<double>(word))
      numbers.push_back(*number);
  if (std::count(text.begin(), text.end(), ',') != 2 || numbers.size() != 3 || std::abs(numbers[0]) > 89 ||
      std::abs(numbers[1]) > 180 || std::abs(numbers[2]) > 360)
    throw badValue("--origin {}: must be LATITUDE,LONGITUDE,HEADING in degrees, within 89, 180 and 360", text);
  return {numbers[0], numbers[1], numbers[2]};
}

Eigen::Vector2d toEarth(const GeoOrigin &origin, const Eigen::Vector2d &xy)
{
  constexpr double kMajor = 6378137, kFlattening = 1 / 298.257223563; // WGS 84
  constexpr double kE2 = kFlattening * (2 - kFlattening);
  const double sin_latitude = std::sin(origin.latitude * kDegree), w2 = 1 - kE2 * sin_latitude * sin_latitude;
  const double normal = kMajor / std::sqrt(w2), meridian = normal * (1 - kE2) / w2;
  const double s = std::sin(origin.heading * kDegree), c = std::cos(origin.heading * kDegree);
  const double east = xy.x() * s - xy.y() * c, north = xy.x() * c + xy.y() * s;
  return {origin.longitude + east / (normal * std::cos(origin.latitude * kDegree)) / kDegree,
          origin.latitude + north / meridian / kDegree};
}

namespace
{
constexpr int kSides = 24; // of a trunk's mesh

/// Foot and top ring of the trunk, one after the other.
std::vector<Eigen::Vector3d> ringsOf(const TrunkRecord &trunk)
{
  const Cylinder cylinder = cylinderOf(trunk);
  std::vector<Eigen::Vector3d> points;
  for (const Eigen::Vector3d &middle : {cylinder.foot, cylinder.top})
    for (int i = 0; i < kSides; ++i) {
      const double angle = 2 * M_PI * i / kSides;
      points.emplace_back(middle + cylinder.radius * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0));
    }
  return points;
}

/// ASCII: a mesh of the trunks, the trajectory as points.
std::string toPly(const MapOfRun &map)
{
  std::string text = fmt::format("ply\nformat ascii 1.0\ncomment {}; metres\nelement vertex {}\n"
                                 "property float x\nproperty float y\nproperty float z\n"
                                 "property uchar red\nproperty uchar green\nproperty uchar blue\n"
                                 "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
                                 describe(map.reference), 2 * kSides * map.trunks.size() + map.trajectory.size(),
                                 kSides * map.trunks.size());
  for (const TrunkRecord &trunk : map.trunks)
    for (const Eigen::Vector3d &p : ringsOf(trunk))
      fmt::format_to(std::back_inserter(text), "{:.5f} {:.5f} {:.5f} 213 94 0\n", p.x(), p.y(), p.z());
  for (const StampedPose &pose : map.trajectory)
    fmt::format_to(std::back_inserter(text), "{:.5f} {:.5f} {:.5f} 0 114 178\n", pose.wMb.t.x(), pose.wMb.t.y(),
                   pose.wMb.t.z());
  for (int k = 0; k < static_cast<int>(map.trunks.size()); ++k)
    for (int i = 0; i < kSides; ++i) {
      const int foot = 2 * kSides * k, next = (i + 1) % kSides;
      fmt::format_to(std::back_inserter(text), "4 {} {} {} {}\n", foot + i, foot + next, foot + kSides + next,
                     foot + kSides + i);
    }
  return text;
}

/// Release 12: circles and ids of the trunks, the trajectory.
std::string toDxf(const MapOfRun &map)
{
  std::string text = "0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n0\nENDSEC\n"
                     "0\nSECTION\n2\nTABLES\n0\nTABLE\n2\nLAYER\n70\n3\n";
  constexpr std::pair<const char *, int> kLayers[] = {{"TRUNKS", 1}, {"LABELS", 7}, {"TRAJECTORY", 5}};
  for (const auto &[name, colour] : kLayers)
    text += fmt::format("0\nLAYER\n2\n{}\n70\n0\n62\n{}\n6\nCONTINUOUS\n", name, colour);
  text += "0\nENDTAB\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n";
  for (const TrunkRecord &trunk : map.trunks) {
    const double x = trunk.xy.x(), y = trunk.xy.y(), z = trunk.ground_z + kBreastHeight;
    text +=
        fmt::format("0\nCIRCLE\n8\nTRUNKS\n10\n{:.5f}\n20\n{:.5f}\n30\n{:.5f}\n40\n{:.5f}\n", x, y, z, trunk.radius);
    text += fmt::format("0\nTEXT\n8\nLABELS\n10\n{:.5f}\n20\n{:.5f}\n30\n{:.5f}\n40\n0.2\n1\n{}\n", x + trunk.radius,
                        y + trunk.radius, z, trunk.id);
  }
  text += "0\nPOLYLINE\n8\nTRAJECTORY\n66\n1\n70\n8\n10\n0\n20\n0\n30\n0\n"; // 8: a line in space
  for (const StampedPose &pose : map.trajectory)
    text += fmt::format("0\nVERTEX\n8\nTRAJECTORY\n10\n{:.5f}\n20\n{:.5f}\n30\n{:.5f}\n70\n32\n", pose.wMb.t.x(),
                        pose.wMb.t.y(), pose.wMb.t.z());
  return text + "0\nSEQEND\n8\nTRAJECTORY\n0\nENDSEC\n0\nEOF\n";
}

/// A line a tree: place, diameter at breast height, basal area, lean.
std::string toInventory(const MapOfRun &map)
{
  std::string text = "tree,x_m,y_m,position_sigma_m,dbh_cm,dbh_sigma_cm,basal_area_m2,lean_deg,lean_towards_deg\n";
  for (const TrunkRecord &trunk : map.trunks) {
    const double towards = std::atan2(trunk.lean.y(), trunk.lean.x()) * 180 / M_PI; // from x, counter-clockwise
    fmt::format_to(std::back_inserter(text), "{},{:.3f},{:.3f},{:.3f},{:.1f},{:.1f},{:.4f},{:.1f},{:.0f}\n", trunk.id,
                   trunk.xy.x(), trunk.xy.y(), trunk.positionSigma(), 200 * trunk.radius, 200 * trunk.radiusSigma(),
                   M_PI * trunk.radius * trunk.radius, std::atan(trunk.lean.norm()) * 180 / M_PI, towards);
  }
  return text;
}

/// To one part of \p parts and no farther: what lies behind is noise.
double rounded(double value, double parts) { return std::round(value * parts) / parts; }

/// Points of the trunks with their figures and a line of the trajectory: in degrees where \p origin tells how, else in
/// metres of the world, which the file says.
std::string toGeoJson(const MapOfRun &map, const std::optional<GeoOrigin> &origin)
{
  using Json = nlohmann::ordered_json;
  const auto place = [&origin](const Eigen::Vector2d &xy) -> Json {
    if (!origin)
      return {rounded(xy.x(), 1e4), rounded(xy.y(), 1e4)};
    const Eigen::Vector2d degrees = toEarth(*origin, xy);
    return {rounded(degrees.x(), 1e9), rounded(degrees.y(), 1e9)};
  };
  Json json = {{"type", "FeatureCollection"},
               {"name", map.name},
               {"description", describe(map.reference)},
               {"units", origin ? "degrees, WGS 84" : "metres of the run's world, no place on the earth"},
               {"features", Json::array()}};
  for (const TrunkRecord &trunk : map.trunks)
    json["features"].push_back({{"type", "Feature"},
                                {"id", trunk.id},
                                {"geometry", {{"type", "Point"}, {"coordinates", place(trunk.xy)}}},
                                {"properties",
                                 {{"tree", trunk.id},
                                  {"dbh_cm", rounded(200 * trunk.radius, 1e2)},
                                  {"dbh_sigma_cm", rounded(200 * trunk.radiusSigma(), 1e2)},
                                  {"position_sigma_m", rounded(trunk.positionSigma(), 1e4)},
                                  {"probability", rounded(trunk.probability, 1e4)},
                                  {"views", trunk.observations}}}});
  Json line = Json::array();
  for (const StampedPose &pose : map.trajectory)
    line.push_back(place(pose.wMb.t.head<2>()));
  if (line.size() > 1)
    json["features"].push_back({{"type", "Feature"},
                                {"geometry", {{"type", "LineString"}, {"coordinates", line}}},
                                {"properties", {{"name", "trajectory"}}}});
  return json.dump(1) + "\n";
}

/// The pictures that a run was made of, as they lie on the disk.
struct PicturesOfRun
{
  CameraModel lens;                          ///< that they were taken with
  std::map<std::int64_t, std::string> names; ///< by their stamps [ns]
  std::string note;                          ///< what a user has to know of them
};

/// Where the input of \p run is not there any more: the rectified camera of \p map, and names made of the stamps.
PicturesOfRun picturesOf(const std::string &run, const MapOfRun &map)
{
  PicturesOfRun pictures{{map.camera, Distortion::none, {}}, {}, ""};
  for (const StampedPose &pose : map.trajectory)
    pictures.names[pose.stamp_ns] = fmt::format("{}.png", pose.stamp_ns);
  const RunInput input = readInputOfRun(run + "/summary.json");
  try {
    SourceOptions options;
    options.camera_path = input.camera_path;
    if (input.camera_path.empty() && !AslSource::accepts(input.path))
      options.field_of_view_deg = 2 * std::atan(0.5 * map.camera.width / map.camera.fx) / kDegree;
    const auto source = std::filesystem::exists(std::filesystem::path(input.path).parent_path())
                            ? openSource(input.path, options)
                            : nullptr;
    if (const auto *recorded = dynamic_cast<const RecordedSource *>(source.get())) {
      pictures.lens = recorded->lens();
      for (const FrameTrace &frame : readFrames(run))
        if (const std::string name = recorded->pictureName(frame.index); !name.empty())
          pictures.names[frame.stamp_ns] = name;
      if (dynamic_cast<const VideoSource *>(recorded) != nullptr)
        pictures.note = fmt::format("the pictures are named as `ffmpeg -i {} -fps_mode passthrough %06d.png` names "
                                    "those of the video",
                                    input.path);
      return pictures;
    }
  }
  catch (const vpException &) { // moved since, or changed
  }
  pictures.note = fmt::format("{}: is not there any more: the pictures are named by their stamps [ns], and the camera "
                              "is that of rectified ones",
                              input.path);
  return pictures;
}

// COLMAP's text model: camera from world, quaternion w first, the corner of the first pixel at (0, 0).

std::string toColmapCamera(const CameraModel &lens)
{
  const PinholeCamera &camera = lens.pinhole;
  const auto &k = lens.coefficients;
  const char *model = "PINHOLE";
  std::string distortion;
  if (lens.distortion == Distortion::fov) {
    model = "FOV";
    distortion = fmt::format(" {:.9g}", k[0]);
  }
  else if (lens.distortion != Distortion::none) {
    model = lens.distortion == Distortion::equidistant ? "OPENCV_FISHEYE" : "OPENCV";
    distortion = fmt::format(" {:.9g} {:.9g} {:.9g} {:.9g}", k[0], k[1], k[2], k[3]);
  }
  return fmt::format(
      "# CAMERA_ID, MODEL, WIDTH, HEIGHT, fx, fy, cx, cy and distortion\n1 {} {} {} {:.9g} {:.9g} {:.9g} "
      "{:.9g}{}\n",
      model, camera.width, camera.height, camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5, distortion);
}

std::string toColmapImages(const MapOfRun &map, const PicturesOfRun &pictures)
{
  std::string text = "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] as (X, Y, POINT3D_ID)\n";
  int id = 0;
  for (const StampedPose &pose : map.trajectory) {
    const Pose cMw = (pose.wMb * map.bMc).inverse();
    const Eigen::Quaterniond q(cMw.R);
    fmt::format_to(std::back_inserter(text), "{} {:.12g} {:.12g} {:.12g} {:.12g} {:.9f} {:.9f} {:.9f} 1 {}\n\n", ++id,
                   q.w(), q.x(), q.y(), q.z(), cMw.t.x(), cMw.t.y(), cMw.t.z(), pictures.names.at(pose.stamp_ns));
  }
  return text;
}

/// Points on the surfaces of the trunks.
std::string toColmapPoints(const MapOfRun &map)
{
  constexpr int kRound = 24, kUp = 26; // points round a trunk and up it
  std::string text = "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n";
  int id = 0;
  for (const TrunkRecord &trunk : map.trunks) {
    const Cylinder cylinder = cylinderOf(trunk);
    for (int up = 0; up < kUp; ++up)
      for (int i = 0; i < kRound; ++i) {
        const double angle = 2 * M_PI * i / kRound;
        const Eigen::Vector3d p = cylinder.foot + (cylinder.top - cylinder.foot) * up / (kUp - 1) +
                                  cylinder.radius * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
        fmt::format_to(std::back_inserter(text), "{} {:.5f} {:.5f} {:.5f} 213 94 0 0\n", ++id, p.x(), p.y(), p.z());
      }
  }
  return text;
}

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
