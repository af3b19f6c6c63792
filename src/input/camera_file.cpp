// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/failure.h"
#include "geometry/names.h"
#include "input/camera_plausibility.h"
#include "input/regular_file.h"
#include "input/sensor_yaml.h"
#include "input/yaml_file.h"

#include <bole/open_source.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <set>
#include <visp3/core/vpException.h>
#include <visp3/core/vpXmlParserCamera.h>

namespace bole
{
namespace
{
constexpr std::size_t kMostNames = 100; // of cameras in one file: each is looked for on its own
const std::set<std::string> kCameraKeys = {
    "sensor_type", "comment",      "T_BS",       "rate_hz",          "resolution",
    "intrinsics",  "camera_model", "camera_fov", "distortion_model", "distortion_coefficients"};
const std::set<std::string> kSensorKeys = {"sensor_type",
                                           "comment",
                                           "T_BS",
                                           "rate_hz",
                                           "gyroscope_noise_density",
                                           "gyroscope_random_walk",
                                           "accelerometer_noise_density",
                                           "accelerometer_random_walk"};

/// Of a side of a picture [px].
bool isSide(double v) { return v >= 8 && v <= 16384 && v == std::floor(v); }

PinholeCamera readPinhole(const SensorYaml &yaml)
{
  if (yaml.has("camera_model") && yaml.text("camera_model") != "pinhole")
    yaml.fail("camera_model", "pinhole");
  const auto size = yaml.numbers("resolution");
  if (size.size() != 2 || !isSide(size[0]) || !isSide(size[1]))
    yaml.fail("resolution", "width and height in pixels, 8 to 16384");
  const auto k = yaml.numbers("intrinsics");
  if (k.size() != 4 || !(k[0] > 0) || !(k[1] > 0))
    yaml.fail("intrinsics", "fx, fy, cx, cy in pixels with fx, fy > 0");
  return {k[0], k[1], k[2], k[3], static_cast<int>(size[0]), static_cast<int>(size[1])};
}

void readDistortion(const SensorYaml &yaml, CameraModel &model)
{
  const std::string name = yaml.has("distortion_model") ? yaml.text("distortion_model") : "none";
  const auto known = valueNamed(name == "radtan" ? "radial-tangential" : name, Distortion::fov);
  if (!known)
    yaml.fail("distortion_model", "none, radial-tangential, equidistant or fov");
  model.distortion = *known;
  if (model.distortion == Distortion::none)
    return;
  const std::size_t needed = model.distortion == Distortion::fov ? 1 : 4;
  auto k = yaml.numbers("distortion_coefficients");
  if (needed == 4 && k.size() == 5 && k[4] == 0)
    k.pop_back();
  if (k.size() != needed)
    yaml.fail("distortion_coefficients", fmt::format("{} numbers for {}", needed, name));
  if (model.distortion == Distortion::fov && (k[0] < 0 || k[0] > 3))
    yaml.fail("distortion_coefficients", "0 to 3 rad");
  std::copy(k.begin(), k.end(), model.coefficients.begin());
  if (std::all_of(k.begin(), k.end(), [](double v) { return v == 0; }))
    model.distortion = Distortion::none;
}

/// OpenCV's calibration, and ROS's camera_info, which has the same keys. The camera looks straight ahead.
MountedCamera readCalibration(const SensorYaml &yaml)
{
  MountedCamera camera{{}, forwardCamera()};
  PinholeCamera &pinhole = camera.model.pinhole;
  const auto size = [&yaml](const char *key) {
    const auto numbers = yaml.numbers(key);
    if (numbers.size() != 1 || !isSide(numbers[0]))
      yaml.fail(key, "8 to 16384 px");
    return static_cast<int>(numbers[0]);
  };
  pinhole.width = size("image_width");
  pinhole.height = size("image_height");
  const auto k = yaml.matrix("camera_matrix");
  if (k.size() != 9 || !(k[0] > 0) || !(k[4] > 0))
    yaml.fail("camera_matrix", "a 3x3 matrix with focal lengths above 0");
  pinhole.fx = k[0];
  pinhole.fy = k[4];
  pinhole.cx = k[2];
  pinhole.cy = k[5];
  const std::string model = yaml.has("distortion_model") ? yaml.text("distortion_model") : "plumb_bob";
  if (model != "plumb_bob" && model != "equidistant")
    yaml.fail("distortion_model", "plumb_bob or equidistant");
  auto d = yaml.has("distortion_coefficients") ? yaml.matrix("distortion_coefficients") : std::vector<double>();
  if (d.size() > 5 && std::any_of(d.begin() + 5, d.end(), [](double v) { return v != 0; }))
    yaml.fail("distortion_coefficients", "at most 5 numbers that are not 0");
  d.resize(5, 0);
  if (model == "equidistant")
    camera.model.distortion = Distortion::equidistant;
  else if (std::any_of(d.begin(), d.end(), [](double v) { return v != 0; }))
    camera.model.distortion = Distortion::radial_tangential;
  constexpr double kLargestRest_px = 1;
  if (model == "plumb_bob" && d[4] != 0 && foldThirdCoefficient(pinhole, d[4], d[0], d[1]) > kLargestRest_px)
    yaml.fail("distortion_coefficients", "radial by two coefficients to 1 px: calibrate with k3 = 0 (CALIB_FIX_K3)");
  std::copy_n(d.begin(), 4, camera.model.coefficients.begin());
  return camera;
}

/// Throws where \p camera, read from \p yaml, cannot be one.
void requireCamera(const MountedCamera &camera, const SensorYaml &yaml, const char *pinhole_key)
{
  using Part = Implausibility::Part;
  const Implausibility fault = implausibility(camera);
  if (fault.part != Part::none)
    yaml.refuse(fault.part == Part::pinhole      ? pinhole_key
                : fault.part == Part::distortion ? "distortion_coefficients"
                                                 : "T_BS",
                fault.text);
}

MountedCamera readYaml(const std::string &path)
{
  if (const SensorYaml any(path, {}); any.has("camera_matrix")) {
    const MountedCamera camera = readCalibration(any);
    requireCamera(camera, any, "camera_matrix");
    return camera;
  }
  const SensorYaml yaml(path, kCameraKeys);
  MountedCamera camera;
  camera.model.pinhole = readPinhole(yaml);
  readDistortion(yaml, camera.model);
  camera.bMc = yaml.has("T_BS") ? yaml.rigidMotion("T_BS") : forwardCamera();
  requireCamera(camera, yaml, "intrinsics");
  return camera;
}

/// Names of the cameras in ViSP's XML: its parser wants to be told the one it is to read.
std::set<std::string> cameraNames(const std::string &path)
{
  const std::string text = readSmallFile(path), tag = "<name>", blanks = " \t\r\n";
  std::set<std::string> names;
  for (std::size_t at = text.find(tag); at != std::string::npos; at = text.find(tag, at)) {
    at += tag.size();
    const std::string name = text.substr(at, text.find('<', at) - at);
    const std::size_t first = std::min(name.find_first_not_of(blanks), name.size());
    names.insert(name.substr(first, name.find_last_not_of(blanks) + 1 - first));
  }
  if (names.size() > kMostNames)
    throw ioError("{}: {} names in it, must be at most {}", path, names.size(), kMostNames);
  return names;
}

bool readXmlModel(const std::string &path, const std::string &name, int width, int height, CameraModel &model)
{
  for (const auto type :
       {vpCameraParameters::perspectiveProjWithDistortion, vpCameraParameters::perspectiveProjWithoutDistortion}) {
    vpXmlParserCamera parser;
    vpCameraParameters cam;
    if (parser.parse(cam, path, name, type, static_cast<unsigned>(width), static_cast<unsigned>(height)) !=
        vpXmlParserCamera::SEQUENCE_OK)
      continue;
    model.pinhole =
        PinholeCamera::fromVisp(cam, static_cast<int>(parser.getWidth()), static_cast<int>(parser.getHeight()));
    if (type == vpCameraParameters::perspectiveProjWithDistortion && cam.get_kud() != 0) {
      model.distortion = Distortion::radial_tangential;
      model.coefficients = {{cam.get_kud(), 0, 0, 0}};
    }
    return true;
  }
  return false;
}

MountedCamera readXml(const std::string &path, int width, int height)
{
  MountedCamera camera{{}, forwardCamera()};
  int found = 0;
  const auto names = cameraNames(path);
  try {
    for (const std::string &name : names)
      found += readXmlModel(path, name, width, height, camera.model) ? 1 : 0;
  }
  catch (const vpException &error) { // ViSP refuses what it reads, without the name of the file
    throw badValue("{}: {}", path, error.getStringMessage());
  }
  const std::string size = width > 0 ? fmt::format(" for {}x{} images", width, height) : "";
  if (found != 1)
    throw ioError("{}: {} ViSP cameras{} in it, must be one", path, found, size);
  PinholeCamera &pinhole = camera.model.pinhole;
  if (pinhole.width == 0 || pinhole.height == 0) {
    pinhole.width = width;
    pinhole.height = height;
  }
  if (!(pinhole.fx > 0) || !(pinhole.fy > 0) || pinhole.width <= 0 || pinhole.height <= 0)
    throw ioError("{}: px, py, image_width and image_height must be > 0", path);
  if (const Implausibility fault = implausibility(camera); fault.part != Implausibility::Part::none)
    throw badValue("{}: {}", path, fault.text);
  return camera;
}
} // namespace

Pose forwardCamera()
{
  Eigen::Matrix3d bRc;
  bRc << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return Pose(bRc, Eigen::Vector3d::Zero());
}

MountedCamera readCamera(const std::string &path, int width, int height)
{
  openRegularFile(path); // whatever its name
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension != ".xml" && extension != ".yaml" && extension != ".yml")
    throw ioError("{}: a camera file must end in .yaml, .yml or .xml", path);
  return extension == ".xml" ? readXml(path, width, height) : readYaml(path);
}

std::optional<double> readFrameRate(const std::string &path)
{
  const std::string extension = std::filesystem::path(path).extension().string();
  if (!std::filesystem::is_regular_file(path) || (extension != ".yaml" && extension != ".yml"))
    return std::nullopt;
  const SensorYaml yaml(path, {});
  if (!yaml.has("rate_hz"))
    return std::nullopt;
  const auto rate = yaml.numbers("rate_hz");
  if (rate.size() != 1 || !(rate[0] >= 1e-3 && rate[0] <= 1e4))
    yaml.fail("rate_hz", "in [0.001, 10000]");
  return rate[0];
}

Pose readSensorPose(const std::string &path)
{
  if (!std::filesystem::exists(path))
    return Pose();
  const SensorYaml yaml(path, kSensorKeys);
  return yaml.has("T_BS") ? yaml.rigidMotion("T_BS") : Pose();
}
} // namespace bole
