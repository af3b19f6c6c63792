// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Camera files: EuRoC `sensor.yaml` and ViSP's camera XML.

#include <bole/camera.h>
#include <bole/pose.h>

#include <string>

namespace bole
{
/// A calibrated camera and where it sits in the body.
struct MountedCamera
{
  CameraModel model;
  Pose bMc;
};

/// Pose in the body (x forward, y left, z up) of a camera at its origin that looks straight ahead.
Pose forwardCamera();

/// Reads a camera: EuRoC YAML (`.yaml`, `.yml`) or ViSP XML (`.xml`).
///
/// YAML: keys of the EuRoC datasets and no others; distortion_model is `none`, `radial-tangential`
/// (or `radtan`; k1 k2 p1 p2, a fifth coefficient must be 0), `equidistant` (k1 .. k4) or `fov` (s
/// [rad]). `T_BS` takes coordinates of the camera to those of the body; without it the camera is
/// forwardCamera(). XML: read by vpXmlParserCamera, the model with distortion where there is one
/// (kud becomes k1); a file with several cameras is resolved by \p width and \p height [px], 0 for
/// any.
///
/// Errors: vpException "file:line: key = value, must be ..." for an unknown, repeated, missing,
/// mistyped or out-of-range key, and for a T_BS that is not a rigid motion.
MountedCamera readCamera(const std::string &path, int width = 0, int height = 0);

/// `T_BS` of an EuRoC `sensor.yaml` of any sensor; identity when the file is absent or has no such
/// key.
Pose readSensorPose(const std::string &path);
} // namespace bole
