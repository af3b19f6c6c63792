// SPDX-License-Identifier: GPL-2.0-or-later
#include "messages.h"

#include "input/rectifier.h"
#include "input/sensor_yaml.h"
#include <bole/open_source.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <gmock/gmock.h>

using namespace bole;
using bole::test::messageOf;
using testing::HasSubstr;
namespace fs = std::filesystem;

namespace
{
class CameraFile : public testing::Test
{
protected:
  CameraFile()
  {
    std::string pattern = (fs::temp_directory_path() / "bole-camera-XXXXXX").string();
    m_folder = mkdtemp(pattern.data());
  }
  ~CameraFile() override { fs::remove_all(m_folder); }
  std::string write(const std::string &name, const std::string &text) const
  {
    std::ofstream(m_folder / name) << text;
    return (m_folder / name).string();
  }
  fs::path m_folder;
};

const char *const kEuroc = R"(# Camera of a flying robot
sensor_type: camera
comment: left
T_BS:
  cols: 4
  rows: 4
  data: [0.0, -1.0, 0.0, 0.1,
         1.0, 0.0, 0.0, 0.2,
         0.0, 0.0, 1.0, 0.3,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.654, 457.296, 367.215, 248.375]
distortion_model: radial-tangential
distortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]
)";

const char *const kXml = R"(<?xml version="1.0"?>
<root>
  <camera>
    <name>Camera</name>
    <image_width>640</image_width>
    <image_height>480</image_height>
    <model>
      <type>perspectiveProjWithoutDistortion</type>
      <px>547.5</px><py>542.1</py><u0>338.7</u0><v0>234.5</v0>
    </model>
    <model>
      <type>perspectiveProjWithDistortion</type>
      <px>558.5</px><py>556.1</py><u0>330.7</u0><v0>230.5</v0><kud>-0.17</kud><kdu>0.18</kdu>
    </model>
  </camera>
</root>
)";
} // namespace

TEST_F(CameraFile, TellsTheRateOfItsPictures)
{
  const std::string euroc = kEuroc;
  EXPECT_EQ(readFrameRate(write("camera.yaml", euroc)), 20);
  std::string silent = euroc, wrong = euroc;
  silent.erase(silent.find("rate_hz: 20\n"), 12);
  EXPECT_EQ(readFrameRate(write("silent.yaml", silent)), std::nullopt);
  wrong.replace(wrong.find("rate_hz: 20"), 11, "rate_hz: -1");
  EXPECT_THAT(messageOf([&] { readFrameRate(write("wrong.yaml", wrong)); }), HasSubstr("rate_hz = -1, must be"));
  EXPECT_EQ(readFrameRate(""), std::nullopt);
}

TEST_F(CameraFile, ReadsEuroc)
{
  const MountedCamera camera = readCamera(write("sensor.yaml", kEuroc));
  EXPECT_EQ(camera.model.pinhole.width, 752);
  EXPECT_DOUBLE_EQ(camera.model.pinhole.fy, 457.296);
  EXPECT_EQ(camera.model.distortion, Distortion::radial_tangential);
  EXPECT_DOUBLE_EQ(camera.model.coefficients[2], 0.00019359);
  EXPECT_NEAR((camera.bMc.t - Eigen::Vector3d(0.1, 0.2, 0.3)).norm(), 0, 1e-15);
  EXPECT_NEAR(camera.bMc.R(1, 0), 1, 1e-12);
}

TEST_F(CameraFile, ReadsVispXmlWithItsDistortion)
{
  const MountedCamera camera = readCamera(write("camera.xml", kXml), 640, 480);
  EXPECT_EQ(camera.model.pinhole.height, 480);
  EXPECT_DOUBLE_EQ(camera.model.pinhole.fx, 558.5);
  EXPECT_EQ(camera.model.distortion, Distortion::radial_tangential);
  EXPECT_DOUBLE_EQ(camera.model.coefficients[0], -0.17);
  EXPECT_NEAR((camera.bMc.R - forwardCamera().R).norm(), 0, 1e-15);
  EXPECT_THAT(messageOf([&] { readCamera(write("camera.xml", kXml), 320, 240); }),
              HasSubstr("0 ViSP cameras for 320x240"));
}

TEST_F(CameraFile, ReadsTheModelOfTheArDrone1)
{
  const MountedCamera camera =
      readCamera(write("c.yaml", "resolution: [320, 240]\nintrinsics: [215.1, 215.8, 160.7, 123.3]\n"
                                 "distortion_model: fov\ndistortion_coefficients: [0.272]\n"));
  EXPECT_EQ(camera.model.distortion, Distortion::fov);
  EXPECT_DOUBLE_EQ(camera.model.coefficients[0], 0.272);
}

TEST_F(CameraFile, ReadsCalibrationsOfOpenCvAndRos)
{
  const std::string opencv = R"(%YAML:1.0
image_width: 320
image_height: 240
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 205.4, 0., 161.2, 0., 205.0, 111.9, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.2, 0.05, -0.003, 0.002, 0.01 ]
avg_reprojection_error: 1.1
)";
  const MountedCamera camera = readCamera(write("opencv.yml", opencv));
  EXPECT_EQ(camera.model.pinhole.height, 240);
  EXPECT_DOUBLE_EQ(camera.model.pinhole.cy, 111.9);
  EXPECT_DOUBLE_EQ(camera.model.coefficients[2], -0.003);
  // The third radial coefficient is in the other two: at the corner to a fifth of a pixel.
  const double r2 = std::pow(161.2 / 205.4, 2) + std::pow(128.1 / 205.0, 2);
  const double full = 1 - 0.2 * r2 + 0.05 * r2 * r2 + 0.01 * r2 * r2 * r2;
  const double folded = 1 + camera.model.coefficients[0] * r2 + camera.model.coefficients[1] * r2 * r2;
  EXPECT_NEAR(full * std::sqrt(r2) * 205, folded * std::sqrt(r2) * 205, 0.2);
  const std::string ros = "image_width: 320\nimage_height: 240\ncamera_name: front\n"
                          "camera_matrix: {rows: 3, cols: 3, data: [200, 0, 160, 0, 201, 120, 0, 0, 1]}\n"
                          "distortion_model: plumb_bob\n"
                          "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n";
  EXPECT_DOUBLE_EQ(readCamera(write("ros.yaml", ros)).model.pinhole.fy, 201);
}

TEST_F(CameraFile, RefusesCamerasThatCannotBe)
{
  const auto refusal = [this](const std::string &text) {
    return messageOf([&] { readCamera(write("c.yaml", "resolution: [320, 240]\n" + text)); });
  };
  EXPECT_THAT(refusal("intrinsics: [1.0e-9, 1.0e-9, 160, 120]\n"), HasSubstr("field of view"));
  EXPECT_THAT(refusal("intrinsics: [1.0e+9, 1.0e+9, 160, 120]\n"), HasSubstr("field of view"));
  EXPECT_THAT(refusal("intrinsics: [200, 2000, 160, 120]\n"), HasSubstr("fx / fy"));
  EXPECT_THAT(refusal("intrinsics: [200, 200, 400, 120]\n"), HasSubstr("principal point"));
  EXPECT_THAT(refusal("intrinsics: [200, 200, 160, 120]\ndistortion_model: radtan\n"
                      "distortion_coefficients: [1.0e+300, 0, 0, 0]\n"),
              HasSubstr("folds"));
  EXPECT_THAT(refusal("intrinsics: [200, 200, 160, 120]\ndistortion_model: radtan\n"
                      "distortion_coefficients: [-2.5, 0, 0, 0]\n"),
              HasSubstr("folds"));
  EXPECT_THAT(refusal("intrinsics: [200, 200, 160, 120]\nT_BS: [0,0,1,1.0e+9, -1,0,0,0, 0,-1,0,0, 0,0,0,1]\n"),
              HasSubstr("from the body"));
  EXPECT_THAT(refusal("intrinsics: [200, 200, 160, 120]\nT_BS: [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n"),
              HasSubstr("c.yaml:3: T_BS: no rotation in the body"));
  EXPECT_THAT(refusal("intrinsics: [200, 2000, 160, 120]\n"), HasSubstr("c.yaml:2: intrinsics: fx / fy"));
  EXPECT_THAT(refusal("intrinsics: [200, 200, 160, 120]\ndistortion_model: equidistant\n"
                      "distortion_coefficients: [-9, 0, 0, 0]\n"),
              HasSubstr("c.yaml:4: distortion_coefficients: the distortion folds"));
}

TEST_F(CameraFile, AnXmlOfAnySizeIsRefusedInALine)
{
  EXPECT_THAT(messageOf([&] { readCamera(write("c.xml", "<name>" + std::string(900'000, ' '))); }),
              HasSubstr("0 ViSP cameras"));
  EXPECT_THAT(messageOf([&] { readCamera(write("c.xml", std::string(2'000'000, '<'))); }),
              HasSubstr("larger than 1000000 bytes"));
  std::string many;
  for (int k = 0; k < 200; ++k)
    many += "<name>" + std::to_string(k) + "</name>";
  EXPECT_THAT(messageOf([&] { readCamera(write("c.xml", many)); }), HasSubstr("200 names in it, must be at most 100"));
}

TEST_F(CameraFile, NamesFileLineAndKeyOfAMistake)
{
  const std::string good = "resolution: [320, 240]\nintrinsics: [200, 200, 160, 120]\n";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {good + "fisheye: 1\n", "c.yaml:3: unknown key \"fisheye\""},
      {good + "resolution: [320, 240]\n", "c.yaml:3: repeated key \"resolution\""},
      {good + "distortion_model: cubic\n", "c.yaml:3: distortion_model = cubic, must be none"},
      {good + "distortion_model: equidistant\ndistortion_coefficients: [1, 2]\n",
       "c.yaml:4: distortion_coefficients = [1, 2], must be 4 numbers"},
      {good + "distortion_model: radtan\n", "c.yaml: the key \"distortion_coefficients\" is missing"},
      {good + "camera_model: omni\n", "c.yaml:3: camera_model = omni, must be pinhole"},
      {good + "T_BS: [1, 0, 0]\n", "c.yaml:3: T_BS = [1, 0, 0], must be 16 numbers"},
      {good + "T_BS: [2,0,0,0,0,2,0,0,0,0,2,0,0,0,0,1]\n", "must be a rigid motion"},
      {"resolution: [320]\nintrinsics: [200, 200, 160, 120]\n",
       "c.yaml:1: resolution = [320], must be width and height"},
      {"resolution: [320, 240.5]\nintrinsics: [200, 200, 160, 120]\n", "c.yaml:1: resolution"},
      {"resolution: [320, 240]\nintrinsics: [200, abc, 160, 120]\n",
       "c.yaml:2: intrinsics = [200, abc, 160, 120], must be finite numbers"},
      {"resolution: [320, 240]\nintrinsics: [-200, 200, 160, 120]\n", "c.yaml:2: intrinsics"},
      {"resolution: [320, 240]\nintrinsics: [.nan, 200, 160, 120]\n", "must be finite numbers"},
      {"resolution: [320, 240]\n", "the key \"intrinsics\" is missing"},
      {"- 1\n", "must be a map"},
      {"", "must be a map"}};
  for (const auto &[text, message] : cases)
    EXPECT_THAT(messageOf([&, t = text] { readCamera(write("c.yaml", t)); }), HasSubstr(message)) << text;
  EXPECT_THAT(messageOf([&] { readCamera("/none/c.yaml"); }), HasSubstr("/none/c.yaml: no such file"));
  EXPECT_THAT(messageOf([&] { readCamera(write("c.txt", "")); }), HasSubstr("must end in"));
  EXPECT_THAT(messageOf([&] { readCamera(write("c.xml", "<root></root>")); }), HasSubstr("0 ViSP cameras"));
  std::string without_focal = kXml; // ViSP itself refuses it, and does not know where it stood
  without_focal.replace(without_focal.find("<px>547.5"), 9, "<px>none5");
  EXPECT_THAT(messageOf([&] { readCamera(write("c.xml", without_focal)); }), HasSubstr("c.xml: "));
}

namespace
{
/// A smooth scene in normalised coordinates.
double scene(const Eigen::Vector2d &xy) { return 128 + 60 * std::sin(9 * xy.x()) + 50 * std::cos(11 * xy.y()); }

/// Normalised point that the lens bends to the pixel (Newton on central differences).
Eigen::Vector2d undistorted(const CameraModel &model, const Eigen::Vector2d &u_px)
{
  Eigen::Vector2d xy = model.pinhole.ray(u_px).head<2>();
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector2d error = u_px - model.distort(xy);
    xy += Eigen::Vector2d(error.x() / model.pinhole.fx, error.y() / model.pinhole.fy);
  }
  return xy;
}

vpImage<unsigned char> drawn(const CameraModel &model)
{
  vpImage<unsigned char> image(static_cast<unsigned>(model.pinhole.height), static_cast<unsigned>(model.pinhole.width));
  for (int v = 0; v < model.pinhole.height; ++v)
    for (int u = 0; u < model.pinhole.width; ++u)
      image[v][u] = static_cast<unsigned char>(std::lround(scene(undistorted(model, Eigen::Vector2d(u, v)))));
  return image;
}

double worstError(const vpImage<unsigned char> &image, const PinholeCamera &camera)
{
  double worst = 0;
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u)
      worst = std::max(worst, std::abs(image[v][u] - scene(camera.ray(Eigen::Vector2d(u, v)).head<2>())));
  return worst;
}
} // namespace

TEST(Rectifier, TurnsAnImageOfTheLensIntoOneOfItsPinhole)
{
  const CameraModel lenses[] = {
      {{215.1, 215.8, 160.7, 123.3, 320, 240}, Distortion::fov, {{0.272, 0, 0, 0}}},
      {{284.9, 284, 165.7, 68, 320, 180}, Distortion::radial_tangential, {{-0.527, 0.274, 0.0211, -0.0064}}},
      {{190, 190, 160, 120, 320, 240}, Distortion::equidistant, {{0.01, -0.02, 0.004, 0}}},
      {{300, 300, 150, 110, 320, 240}, Distortion::radial_tangential, {{0.2, 0, 0, 0}}},
  };
  for (const CameraModel &lens : lenses) {
    const Rectifier rectifier(lens);
    vpImage<unsigned char> image = drawn(lens);
    rectifier.apply(image);
    EXPECT_LT(worstError(image, rectifier.camera()), 2.5);
    EXPECT_FALSE(rectifier.isIdentity());
    const PinholeCamera &out = rectifier.camera();
    for (const Eigen::Vector2d &corner : {Eigen::Vector2d(0, 0), Eigen::Vector2d(out.width - 1, out.height - 1)})
      EXPECT_TRUE(lens.pinhole.contains(lens.distort(out.ray(corner).head<2>())));
  }
}

TEST(Rectifier, ShrinksWideImagesAndTheirCamera)
{
  const CameraModel lens{{670, 672, 426, 239, 854, 480}, Distortion::none, {}};
  const Rectifier rectifier(lens, 320);
  vpImage<unsigned char> image = drawn(lens);
  rectifier.apply(image);
  EXPECT_EQ(image.getWidth(), 320u);
  EXPECT_EQ(image.getHeight(), 180u);
  EXPECT_EQ(rectifier.camera().width, 320);
  EXPECT_LT(worstError(image, rectifier.camera()), 2.5);
}

TEST(Rectifier, LeavesImagesOfAPinholeAsTheyAre)
{
  const CameraModel lens{{200, 200, 159.5, 119.5, 320, 240}, Distortion::none, {}};
  const Rectifier rectifier(lens, 640);
  vpImage<unsigned char> image = drawn(lens);
  const unsigned char *const pixels = image.bitmap;
  rectifier.apply(image);
  EXPECT_TRUE(rectifier.isIdentity());
  EXPECT_EQ(image.bitmap, pixels);
}

TEST(Rectifier, RefusesAnotherSize)
{
  const Rectifier rectifier({{200, 200, 159.5, 119.5, 320, 240}, Distortion::none, {}});
  vpImage<unsigned char> image(100, 100);
  EXPECT_THAT(messageOf([&] { rectifier.apply(image); }), HasSubstr("image size = 100x100, must be 320x240"));
}
