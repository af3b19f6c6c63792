// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "input/frame_builder.h"
#include "input/yaml_file.h"
#include <bole/open_source.h>

using namespace bole;
using bole::test::messageOf;
using testing::HasSubstr;

namespace
{
class CameraFile : public testing::Test
{
protected:
  std::string write(const std::string &name, const std::string &text) const { return m_folder.write(name, text); }
  test::TemporaryFolder m_folder;
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
  EXPECT_REFUSED("rate_hz = -1, must be", readFrameRate(write("wrong.yaml", wrong)));
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
  EXPECT_REFUSED("0 of its cameras are for images of 320x240 px, must be one: Camera (640x480)",
                 readCamera(write("camera.xml", kXml), 320, 240));
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

TEST_F(CameraFile, ReadsAnyFileThatHoldsACamera)
{
  const auto fx = [this](const std::string &name, const std::string &text) {
    return readCamera(write(name, text), 320, 240).model.pinhole.fx;
  };
  const std::string size = "image_width: 320\nimage_height: 240\n", k = "[201, 0, 160, 0, 201, 120, 0, 0, 1]";
  EXPECT_EQ(fx("c.json", "{\"image_width\": 320, \"image_height\": 240, \"camera_matrix\": {\"data\": " + k + "}}"),
            201);
  EXPECT_EQ(fx("c.txt", size + "K: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n  data: " + k + "\n"), 201);
  EXPECT_EQ(fx("echo", "header: {frame_id: a}\nheight: 240\nwidth: 320\ndistortion_model: plumb_bob\nd: []\nk: " + k +
                           "\n---\n"),
            201);
  EXPECT_EQ(fx("echo1", "height: 240\nwidth: 320\nD: [0, 0, 0, 0, 0]\nK: " + k + "\n"), 201);
  const std::string kalibr = "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [0.01, -0.002, 0.001, 0.0]\n"
                             "  distortion_model: equidistant\n  intrinsics: [201.0, 200.0, 159.5, 119.5]\n"
                             "  resolution: [320, 240]\n  rostopic: /cam0/image_raw\n";
  EXPECT_EQ(readCamera(write("camchain.yaml", kalibr)).model.distortion, Distortion::equidistant);
  EXPECT_EQ(fx("camchain.yaml", kalibr), 201);
  const MountedCamera mounted = readCamera(
      write("imucam.yaml",
            kalibr + "  T_cam_imu:\n  - [0, -1, 0, 0.1]\n  - [0, 0, -1, 0]\n  - [1, 0, 0, 0]\n  - [0, 0, 0, 1]\n"));
  EXPECT_NEAR((mounted.bMc.R - forwardCamera().R).norm(), 0, 1e-12);
  EXPECT_NEAR(mounted.bMc.t.y(), 0.1, 1e-12);
}

TEST_F(CameraFile, AFisheyeIsReadAsOne)
{
  const auto read = [this](const std::string &rest) {
    return readCamera(write("c.yml", "image_width: 320\nimage_height: 240\n"
                                     "camera_matrix: [200, 0, 160, 0, 200, 120, 0, 0, 1]\n" +
                                         rest))
        .model;
  };
  const std::string four = "distortion_coefficients: [-0.02, 0.01, 0.03, -0.02]\n";
  for (const char *word : {"fisheye_model: 1\n", "distortion_model: equidistant\n", "distortion_model: fisheye\n"}) {
    EXPECT_EQ(read(word + four).distortion, Distortion::equidistant) << word;
    EXPECT_DOUBLE_EQ(read(word + four).coefficients[3], -0.02);
    EXPECT_REFUSED("c.yml:5: distortion_coefficients = [0.1, 0, 0, 0, 0.5], must be 4 numbers",
                   read(word + std::string("distortion_coefficients: [0.1, 0, 0, 0, 0.5]\n")));
    EXPECT_EQ(read(word + std::string("distortion_coefficients: [0.1, 0, 0, 0, 0]\n")).distortion,
              Distortion::equidistant);
  }
  EXPECT_EQ(read("fisheye_model: 0\n" + four).distortion, Distortion::radial_tangential);
  EXPECT_EQ(
      read("distortion_model: rational_polynomial\ndistortion_coefficients: [0.1, 0, 0, 0, 0, 0, 0, 0]\n").distortion,
      Distortion::radial_tangential);
  EXPECT_REFUSED(
      "must be 5 numbers",
      read("distortion_model: rational_polynomial\ndistortion_coefficients: [0.1, 0, 0, 0, 0, 0.3, 0, 0]\n"));
}

TEST_F(CameraFile, AMatrixThatIsNoneIsRefusedInALine)
{
  for (const char *k : {"[200, 0, 160, 0, 200, 120, 3, 0, 5]", "[200, 0, 160, 7, 200, 120, 0, 0, 1]",
                        "[200, 9, 160, 0, 200, 120, 0, 0, 1]"}) {
    const std::string message = messageOf([&] {
      readCamera(write("c.yml", "image_width: 320\nimage_height: 240\ncamera_matrix: !!opencv-matrix\n   rows: 3\n"
                                "   cols: 3\n   dt: d\n   data: " +
                                    std::string(k) + "\n"));
    });
    EXPECT_THAT(message, HasSubstr("must be fx 0 cx, 0 fy cy, 0 0 1")) << k;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
  EXPECT_REFUSED("c.yml:3: camera_matrix",
                 readCamera(write("c.yml", "image_width: 320\nimage_height: 240\ncamera_matrix: !!opencv-matrix\n"
                                           "   rows: 3\n   cols: 3\n   dt: d\n   data: [200, 200, 160, 120]\n")));
}

TEST_F(CameraFile, OtherFormsAreToldWhichAreRead)
{
  for (const char *text : {"%YAML:1.0\n---\nmodel_type: PINHOLE\nprojection_parameters:\n   fx: 200.0\n",
                           "%YAML:1.0\nCamera.type: \"PinHole\"\nCamera.fx: 200.0\n",
                           "intrinsics:\n   f_u: 200.0\n   f_v: 200.0\n", "<opencv_storage><K>1</K></opencv_storage>"})
    EXPECT_REFUSED("must be EuRoC's sensor.yaml, a", readCamera(write("c.yaml", text))) << text;
  EXPECT_REFUSED("c.yaml:2: camera_model = omni, must be pinhole",
                 readCamera(write("c.yaml", "cam0:\n  camera_model: omni\n")));
  EXPECT_REFUSED("c.yaml:2: cam1: a second camera", readCamera(write("c.yaml", "cam0: {a: 1}\ncam1: {a: 1}\n")));
}

TEST_F(CameraFile, AnXmlWithoutOneCameraSaysWhy)
{
  const std::string head = "<root><camera>", model = "<model><type>perspectiveProjWithoutDistortion</type><px>200</px>"
                                                     "<py>200</py><u0>160</u0><v0>120</v0></model></camera>";
  const auto refusal = [this](const std::string &text) {
    return messageOf([&] { readCamera(write("c.xml", text), 320, 240); });
  };
  EXPECT_EQ(refusal("<!-- <name>Old</name> -->" + head + model + "</root>"), "") << "no name, no size";
  EXPECT_THAT(refusal("<root></root>"), HasSubstr("c.xml: no <camera> in it"));
  EXPECT_THAT(refusal(head + "<name>A</name>" + model + "<camera><name>B</name>" + model + "</root>"),
              HasSubstr("2 of its cameras are for images of 320x240 px, must be one: A (0x0), B (0x0)"));
  EXPECT_THAT(refusal(head + "<model><type>other</type></model></camera></root>"),
              HasSubstr("c.xml:1: <camera> has no <model> of a type that is known"));
  EXPECT_THAT(refusal("<name>" + std::string(900'000, ' ')), HasSubstr("<name> is never closed"));
  EXPECT_THAT(refusal(std::string(2'000'000, '<')), HasSubstr("must be at most 1000000"));
  std::string deep;
  for (int k = 0; k < 200'000; ++k)
    deep += "<a>";
  EXPECT_THAT(refusal(deep), HasSubstr("is nested deeper than 32"));
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
      {good + "distortion_model: radtan\ndistortion_coefficients: [-2.5, 0, 0, 0]\n", "the distortion folds"},
      {good + "distortion_model: equidistant\ndistortion_coefficients: [-9, 0, 0, 0]\n",
       "c.yaml:4: distortion_coefficients: the distortion folds"},
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
  EXPECT_REFUSED("/none/c.yaml: no such file", readCamera("/none/c.yaml"));
  std::string without_focal = kXml;
  without_focal.replace(without_focal.find("<px>547.5"), 9, "<px>none5");
  EXPECT_REFUSED("c.xml:10: px = \"none5\", must be a number", readCamera(write("c.xml", without_focal)));
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
  EXPECT_REFUSED("image size = 100x100, must be 320x240", rectifier.apply(image));
}
