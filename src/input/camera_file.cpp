// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/failure.h"
#include "geometry/names.h"
#include "geometry/parse_number.h"
#include "input/camera_plausibility.h"
#include "input/regular_file.h"
#include "input/yaml_file.h"

#include <bole/open_source.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <map>
#include <optional>
#include <set>
#include <utility>

namespace bole
{
namespace
{
constexpr const char *kForms =
    "EuRoC's sensor.yaml, a calibration of OpenCV, ROS (camera_info) or Kalibr, or ViSP's XML";
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

/// The coefficients of a lens under \p key, \p least to \p most of them: what stands behind must be 0.
std::vector<double> readCoefficients(const SensorYaml &yaml, const std::string &key, std::size_t least,
                                     std::size_t most, const std::string &model)
{
  std::vector<double> k = yaml.numbers(key);
  while (k.size() > most && k.back() == 0)
    k.pop_back();
  if (k.size() < least || k.size() > most)
    yaml.fail(key, fmt::format("{} numbers for {}", most, model));
  k.resize(most, 0);
  return k;
}

void setDistortion(CameraModel &model, Distortion distortion, const std::vector<double> &k)
{
  model.distortion = std::all_of(k.begin(), k.end(), [](double v) { return v == 0; }) ? Distortion::none : distortion;
  std::copy_n(k.begin(), std::min(k.size(), model.coefficients.size()), model.coefficients.begin());
}

void readDistortion(const SensorYaml &yaml, const std::string &key, CameraModel &model)
{
  const std::string name = yaml.has("distortion_model") ? yaml.text("distortion_model") : "none";
  const auto known = valueNamed(name == "radtan" ? "radial-tangential" : name, Distortion::fov);
  if (!known)
    yaml.fail("distortion_model", "none, radial-tangential, equidistant or fov");
  if (*known == Distortion::none)
    return;
  const std::size_t count = *known == Distortion::fov ? 1 : 4;
  const std::vector<double> k = readCoefficients(yaml, key, count, count, name);
  if (*known == Distortion::fov && (k[0] < 0 || k[0] > 3))
    yaml.fail(key, "0 to 3 rad");
  setDistortion(model, *known, k);
}

/// OpenCV's calibration, and ROS's camera_info as a file or a printed message. The camera looks straight ahead.
MountedCamera readCalibration(const SensorYaml &yaml, const std::string &matrix_key)
{
  const auto keyOf = [&yaml](std::initializer_list<const char *> names) {
    const auto *const found =
        std::find_if(names.begin(), names.end(), [&](const char *name) { return yaml.has(name); });
    return std::string(found == names.end() ? *names.begin() : *found);
  };
  MountedCamera camera{{}, forwardCamera()};
  PinholeCamera &pinhole = camera.model.pinhole;
  const auto side = [&yaml](const std::string &key) {
    const auto numbers = yaml.numbers(key);
    if (numbers.size() != 1 || !isSide(numbers[0]))
      yaml.fail(key, "8 to 16384 px");
    return static_cast<int>(numbers[0]);
  };
  pinhole.width = side(keyOf({"image_width", "image_Width", "width"}));
  pinhole.height = side(keyOf({"image_height", "image_Height", "height"}));
  const auto k = yaml.numbers(matrix_key);
  constexpr double kSkew_px = 1e-6;
  if (k.size() != 9 || !(k[0] > 0) || !(k[4] > 0) || std::abs(k[1]) > kSkew_px || k[3] != 0 || k[6] != 0 || k[7] != 0 ||
      k[8] != 1)
    yaml.fail(matrix_key, "fx 0 cx, 0 fy cy, 0 0 1 with fx and fy above 0");
  pinhole.fx = k[0];
  pinhole.fy = k[4];
  pinhole.cx = k[2];
  pinhole.cy = k[5];

  const bool is_fisheye = yaml.has("fisheye_model") && yaml.numbers("fisheye_model") != std::vector<double>{0};
  const std::string model = is_fisheye                     ? "equidistant"
                            : yaml.has("distortion_model") ? yaml.text("distortion_model")
                                                           : "plumb_bob";
  const std::string key = keyOf({"distortion_coefficients", "Distortion_Coefficients", "DistCoeff", "D", "d"});
  if (model == "equidistant" || model == "fisheye") {
    setDistortion(camera.model, Distortion::equidistant, readCoefficients(yaml, key, 4, 4, model));
    return camera;
  }
  if (model != "plumb_bob" && model != "rational_polynomial")
    yaml.fail("distortion_model", "plumb_bob, rational_polynomial or equidistant");
  auto d = yaml.has(key) ? readCoefficients(yaml, key, 0, 5, "plumb_bob") : std::vector<double>(5, 0);
  constexpr double kLargestRest_px = 1;
  if (d[4] != 0 && foldThirdCoefficient(pinhole, d[4], d[0], d[1]) > kLargestRest_px)
    yaml.fail(key, "radial by two coefficients to 1 px: calibrate with k3 = 0 (CALIB_FIX_K3)");
  d.pop_back();
  setDistortion(camera.model, Distortion::radial_tangential, d);
  return camera;
}

/// Throws where \p camera, read from \p yaml, cannot be one: at the key of what is wrong.
void requireCamera(const MountedCamera &camera, const SensorYaml &yaml, const char *pinhole_key,
                   const char *distortion_key, const char *mounting_key)
{
  using Part = Implausibility::Part;
  const Implausibility fault = implausibility(camera);
  if (fault.part != Part::none)
    yaml.refuse(fault.part == Part::pinhole      ? pinhole_key
                : fault.part == Part::distortion ? distortion_key
                                                 : mounting_key,
                fault.text);
}

/// Kalibr's camchain of one camera.
MountedCamera readKalibr(const SensorYaml &chain)
{
  if (chain.has("cam1"))
    chain.refuse("cam1", "a second camera, must be cam0 alone");
  const SensorYaml yaml = chain.at("cam0");
  MountedCamera camera{{}, forwardCamera()};
  camera.model.pinhole = readPinhole(yaml);
  readDistortion(yaml, "distortion_coeffs", camera.model);
  if (yaml.has("T_cam_imu"))
    camera.bMc = yaml.rigidMotion("T_cam_imu").inverse();
  requireCamera(camera, yaml, "intrinsics", "distortion_coeffs", "T_cam_imu");
  return camera;
}

MountedCamera readYaml(const std::string &path)
{
  const SensorYaml any(path, {});
  for (const char *matrix : {"camera_matrix", "Camera_Matrix", "CameraMat", "K", "k"})
    if (any.has(matrix)) {
      const MountedCamera camera = readCalibration(any, matrix);
      requireCamera(camera, any, matrix, matrix, matrix);
      return camera;
    }
  if (any.has("cam0"))
    return readKalibr(any);
  if (!any.has("resolution"))
    throw ioError("{}: no camera that is known, must be {}", path, kForms);
  const SensorYaml yaml(path, kCameraKeys);
  MountedCamera camera;
  camera.model.pinhole = readPinhole(yaml);
  readDistortion(yaml, "distortion_coefficients", camera.model);
  camera.bMc = yaml.has("T_BS") ? yaml.rigidMotion("T_BS") : forwardCamera();
  requireCamera(camera, yaml, "intrinsics", "distortion_coefficients", "T_BS");
  return camera;
}

/// The cameras of ViSP's XML by their names, each by the better one of its models.
std::vector<std::pair<std::string, CameraModel>> readXmlCameras(const std::string &path)
{
  std::vector<std::pair<std::string, CameraModel>> cameras;
  std::optional<CameraModel> model;
  std::map<std::string, std::string> values; // of the camera so far, and of its last model
  for (const XmlElement &element : readXml(path)) {
    const auto number = [&](const char *key) {
      if (const auto value = parseNumber<double>(values[key]))
        return *value;
      throw badValue("{}:{}: {} = \"{}\", must be a number", path, element.line, key, values[key]);
    };
    const auto side = [&](const char *key) {
      if (values.count(key) == 0)
        return 0;
      if (!isSide(number(key)))
        throw badValue("{}:{}: {} = {}, must be 8 to 16384 px", path, element.line, key, values[key]);
      return static_cast<int>(number(key));
    };
    const std::string place = element.path.substr(std::min(element.path.find('/'), element.path.size()));
    if (place == "/camera/model") {
      const bool is_distorted = values["type"] == "perspectiveProjWithDistortion";
      if (!is_distorted && (model || values["type"] != "perspectiveProjWithoutDistortion"))
        continue;
      model = CameraModel();
      model->pinhole = {number("px"), number("py"), number("u0"), number("v0"), 0, 0};
      setDistortion(*model, Distortion::radial_tangential, {is_distorted ? number("kud") : 0, 0, 0, 0});
    }
    else if (place == "/camera") {
      if (!model)
        throw badValue(
            "{}:{}: <camera> has no <model> of a type that is known, must have perspectiveProjWithDistortion "
            "or perspectiveProjWithoutDistortion",
            path, element.line);
      model->pinhole.width = side("image_width");
      model->pinhole.height = side("image_height");
      cameras.emplace_back(values["name"], *std::exchange(model, std::nullopt));
      values.clear();
    }
    else
      values[place.substr(place.rfind('/') + 1)] = element.text;
  }
  return cameras;
}

/// Of the cameras of \p path the one for images of this size.
MountedCamera readXmlCamera(const std::string &path, int width, int height)
{
  const auto cameras = readXmlCameras(path);
  if (cameras.empty())
    throw ioError("{}: no <camera> in it, must be {}", path, kForms);
  MountedCamera camera{{}, forwardCamera()};
  PinholeCamera &pinhole = camera.model.pinhole;
  int fitting = 0;
  std::string names;
  for (const auto &[name, model] : cameras) {
    const PinholeCamera &p = model.pinhole;
    names += fmt::format("{}{} ({}x{})", names.empty() ? "" : ", ", name, p.width, p.height);
    if (width > 0 && p.width > 0 && (p.width != width || p.height != height))
      continue;
    camera.model = model;
    ++fitting;
  }
  if (fitting != 1)
    throw ioError("{}: {} of its cameras are for images of {}, must be one: {}", path, fitting,
                  width > 0 ? fmt::format("{}x{} px", width, height) : "a size that is not known yet", names);
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

bool isXml(const std::string &path)
{
  const std::string text = readSmallFile(path);
  const std::size_t first = text.find_first_not_of("\xEF\xBB\xBF \t\r\n");
  return first != std::string::npos && text[first] == '<';
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
  return isXml(path) ? readXmlCamera(path, width, height) : readYaml(path);
}

std::optional<double> readFrameRate(const std::string &path)
{
  if (path.empty() || isXml(path))
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
