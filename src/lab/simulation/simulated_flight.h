// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A whole recorded flight from a few options: forest, path, camera, sensors; and its file.
#include "simulation/flight_path.h"
#include "simulation/flight_sensors.h"
#include "simulation/forest_renderer.h"
#include "support/h264.h"
#include "support/text.h"
#include <bole/camera.h>
#include <bole/open_source.h>

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace bole
{
// What scene files and commands call the values of an enumeration.

template <class T> using Words = std::vector<std::pair<std::string, T>>;

inline const char *toString(Light light) { return nameOf(light, {"sun", "overcast"}); }
inline const char *toString(Bark bark) { return nameOf(bark, {"dark", "bright", "mixed"}); }
inline const char *toString(PathKind path) { return nameOf(path, {"forward", "lateral", "loop", "slalom"}); }

/// All values of an enumeration by their names.
template <class T> Words<T> wordsOf(T)
{
  Words<T> words;
  for (T value{}; std::string(toString(value)) != kUnknownName; value = static_cast<T>(static_cast<int>(value) + 1))
    words.emplace_back(toString(value), value);
  return words;
}

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

/// The frames of a scene, one after the other: what recordFlight() writes and a trial tracks. Gyro and accelerometer at
/// 200 Hz.
class SceneFrames
{
public:
  /// \p frames: how long the path is. \throw vpException naming the option that is out of its range.
  SceneFrames(const SceneOptions &scene, int frames);
  const Forest &forest() const { return m_forest; }
  /// The next frame with its truth. \p rendered keeps its buffers; with \p truth_images it holds depth and ids too.
  void next(Frame &frame, RenderedFrame &rendered, bool truth_images = false);

private:
  SceneOptions m_scene;
  FlightPath m_path;
  Forest m_forest;
  ForestRenderer m_renderer;
  PoseFilter m_filter;
  SimulatedImu m_imu;
  std::optional<H264Link> m_link;
  std::size_t m_index = 0;
  std::int64_t m_imu_stamp_ns = 0;
};

struct RecordOptions
{
  std::string folder;
  int frames = 120;
  bool truth_images = false; ///< depth and trunk ids
  bool overwrite = false;
};

/// Flies \p scene and writes it as an ASL folder (sequence_writer.h), with the scene beside it as scene.yaml. \p
/// progress is called after each frame with the number of frames done. Law (a test): same scene, same bytes.
void recordFlight(const SceneOptions &scene, const RecordOptions &options,
                  const std::function<void(int)> &progress = {});

} // namespace bole
