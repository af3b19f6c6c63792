// SPDX-License-Identifier: GPL-2.0-or-later
// COLMAP's text model: camera from world, quaternion w first, the corner of the first pixel at (0, 0).
#include "exchange/exchange.h"

#include "geometry/constants.h"
#include "input/recorded_source.h"
#include "output/flight_trace.h"
#include "output/summary_json.h"
#include <bole/cylinder.h>

#include <Eigen/Geometry>

#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <iterator>

namespace bole
{
PicturesOfRun picturesOf(const std::string &run, const MapOfRun &map)
{
  namespace fs = std::filesystem;
  PicturesOfRun pictures{{map.camera, Distortion::none, {}}, {}, ""};
  for (const StampedPose &pose : map.trajectory)
    pictures.names[pose.stamp_ns] = fmt::format("{}.png", pose.stamp_ns);
  const RunInput input = readInputOfRun(run + "/summary.json");
  try {
    SourceOptions options;
    options.camera_path = input.camera_path;
    if (input.camera_path.empty() && !AslSource::accepts(input.path))
      options.field_of_view_deg = 2 * std::atan(0.5 * map.camera.width / map.camera.fx) / kDegree;
    const auto source = fs::exists(fs::path(input.path).parent_path()) ? openSource(input.path, options) : nullptr;
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
} // namespace bole
