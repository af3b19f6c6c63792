// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A whole recorded flight from a few options: forest, path, camera, sensors; and its file.
#include "simulation/flight_sensors.h"
#include "simulation/forest.h"
#include "simulation/forest_renderer.h"
#include "support/text.h"
#include <bole/camera.h>
#include <bole/frame.h>
#include <bole/open_source.h>
#include <bole/pose.h>

#include <cstdint>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

namespace bole
{
enum class PathKind
{
  forward, ///< ahead, weaving 1.2 m
  lateral, ///< sideways sweeps of 1.8 m, slow advance
  loop,    ///< a circle that closes, heading along it
  slalom   ///< round gate trunks left and right, heading along the path
};

struct FlightOptions
{
  PathKind kind = PathKind::forward;
  std::uint64_t seed = 1;
  double speed = 1;        ///< along the path [m/s], 0.05 to 10
  double duration = 12;    ///< [s], 0 to 3600
  double laps = 1;         ///< of a loop, in the time there is, 0.1 to 1000
  double height = 1.2;     ///< over the ground at the start [m], 0.3 to 10
  double wobble_deg = 1.2; ///< of roll and pitch on top of what the acceleration asks for, 0 to 20
};

/// The true motion of the drone: position analytic in time; roll and pitch as a quadrotor needs
/// them for its acceleration (thrust along z of the body), plus a wobble.
///
/// Laws (each a test): the path is continuous in position and attitude; the z axis of the body is
/// parallel to acceleration minus gravity when the wobble is zero; a loop ends where it began.
class FlightPath
{
public:
  explicit FlightPath(const FlightOptions &options);

  Eigen::Vector3d position(double t) const;
  double heading(double t) const;               ///< yaw [rad]
  Eigen::Vector3d acceleration(double t) const; ///< world, without gravity
  Pose bodyPose(double t) const;                ///< wMb
  Eigen::Vector3d bodyRate(double t) const;     ///< angular rate in the body frame [rad/s]

  /// Points of the path, 10 cm apart or less: where nothing may grow.
  std::vector<Eigen::Vector3d> waypoints() const;
  /// Trunks that belong to the path: the gates of the slalom; empty for the others.
  std::vector<SimulatedTrunk> gates() const;

private:
  FlightOptions m_options;
  double m_phase[6];
  double m_swing = 1, m_wave_length = 8, m_radius = 6;
};

inline const char *toString(Light light) { return nameOf(light, {"sun", "overcast"}); }
inline const char *toString(Bark bark) { return nameOf(bark, {"dark", "bright", "mixed"}); }
inline const char *toString(PathKind path) { return nameOf(path, {"forward", "lateral", "loop", "slalom"}); }

struct SceneOptions
{
  ForestOptions forest;
  FlightOptions flight;
  RendererOptions renderer;
  SensorOptions sensors;
  std::vector<SimulatedTrunk> trunks; ///< planted first, as they are
  double rate_hz = 10;                ///< of the camera, 1 to 120
  double exposure_ms = 6;             ///< time of exposure: motion blur, 0 to 100
  double h264_kbps = 0;               ///< bit rate of the drone's video link, 0 = uncompressed, to 20000

  /// One seed for forest, path, sensor noise and image noise.
  void setSeed(std::uint64_t seed);
  /// Throws vpException "name = value, must be ...".
  void validate() const;
};

/// Reads a scene: YAML with the sections forest, flight, camera, sensors, video and trunks, every key optional. Unknown
/// keys and values out of range throw vpException "file:line: key = value, must be ...".
SceneOptions readScene(const std::string &path);
/// The text that readScene() would read back.
std::string sceneText(const SceneOptions &scene);

struct RecordOptions
{
  std::string folder;
  int frames = 120;
  bool truth_images = false; ///< depth and trunk ids
  bool overwrite = false;
};

/// Flies \p scene and writes it as an ASL folder (SequenceWriter), gyro and accelerometer at 200 Hz, with the scene
/// beside it as scene.yaml. \p progress is called after each frame with the number of frames done. Law (a test): same
/// scene, same bytes. \throw vpException naming the option that is out of its range.
void recordFlight(const SceneOptions &scene, const RecordOptions &options,
                  const std::function<void(int)> &progress = {});

/// Writes a flight as an ASL folder (the layout of EuRoC), with the truth beside it.
///
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
  SequenceWriter(const std::string &folder, const CameraModel &camera, double rate_hz, bool overwrite);

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
