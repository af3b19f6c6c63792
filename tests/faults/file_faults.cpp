// SPDX-License-Identifier: GPL-2.0-or-later
// Files that are damaged, hostile, or say what cannot be; and options that ask for it.
#include "fault_list.h"

#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sys/stat.h>

namespace bole::faults
{
namespace
{
namespace fs = std::filesystem;
const char *const kYaml = "mav0/cam0/sensor.yaml";

Fault camera(const std::string &name, const std::string &what, const std::string &says, const std::string &text)
{
  return {"camera file", name, what, Duty::refuse, [=](SpoiltFlight &flight) { flight.replace(kYaml, text); }, says};
}

/// A camera file that says \p more, which may repeat nothing.
std::string pinhole(const std::string &intrinsics, const std::string &more = "")
{
  return "resolution: [320, 240]\nintrinsics: [" + intrinsics + "]\n" + more;
}

std::string aliasBomb()
{
  std::string text = "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]\n";
  for (int i = 1; i < 30; ++i) {
    text += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [";
    for (int k = 0; k < 9; ++k)
      text += (k > 0 ? ", *a" : "*a") + std::to_string(i - 1);
    text += "]\n";
  }
  return text;
}

std::vector<Fault> cameraFiles()
{
  const std::string lens = "distortion_model: radtan\ndistortion_coefficients: [1.0e+300, 0, 0, 0]\n";
  std::vector<Fault> all = {
      camera("yaml_cycle", "an alias that holds itself", "sensor.yaml:", "a: &a [1, *a]\n"),
      camera("yaml_bomb", "aliases that multiply", "aliases make more than", aliasBomb()),
      camera("yaml_deep", "brackets 100,000 deep", "nested deeper", std::string(100'000, '[')),
      camera("focal_1e-9", "a focal length of 1e-9 px", "sensor.yaml:2: intrinsics",
             pinhole("1.0e-9, 1.0e-9, 160, 120")),
      camera("focal_1e9", "one of 1e9 px", "sensor.yaml:2: intrinsics", pinhole("1.0e+9, 1.0e+9, 160, 120")),
      camera("focal_apart", "focal lengths ten times apart", "fx / fy", pinhole("200, 2000, 160, 120")),
      camera("centre_outside", "a principal point outside the picture", "principal point",
             pinhole("200, 200, 400, 120")),
      camera("lens_1e300", "a distortion of 1e300", "sensor.yaml:4: distortion_coefficients",
             pinhole("200, 200, 160, 120", lens)),
      camera("arm_1e9", "a camera 1e9 m from the body", "from the body",
             pinhole("200, 200, 160, 120", "T_BS: [0,0,1,1.0e+9, -1,0,0,0, 0,-1,0,0, 0,0,0,1]\n")),
      camera("no_rotation", "a camera without a rotation", "no rotation",
             pinhole("200, 200, 160, 120", "T_BS: [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n")),
      camera("other_size", "a picture of another size", "must be 640x480",
             "resolution: [640, 480]\nintrinsics: [400, 400, 319.5, 239.5]\n"),
  };
  const auto wrong = [&all](const std::string &name, const std::string &what, const std::string &text) {
    all.push_back(fromTheFirst(
        {"camera file", name, what, Duty::survive, [=](SpoiltFlight &flight) { flight.replace(kYaml, text); }}));
  };
  wrong("focal_5_short", "a focal length 5 % too short", pinhole("190, 190, 159.5, 119.5"));
  wrong("focal_10_long", "one 10 % too long", pinhole("220, 220, 159.5, 119.5"));
  wrong("focal_twice", "one twice as long", pinhole("400, 400, 159.5, 119.5"));
  wrong("focal_unequal", "fy 25 % too short", pinhole("200, 150, 159.5, 119.5"));
  wrong("centre_swapped", "principal point and focal lengths exchanged", pinhole("159.5, 119.5, 200, 200"));
  wrong("arm_pitched", "T_BS pitched by 10 degrees",
        pinhole("200, 200, 159.5, 119.5",
                "T_BS: [0,-0.173648,0.984808,0, -1,0,0,0, 0,-0.984808,-0.173648,0, 0,0,0,1]\n"));
  wrong("arm_inverse", "T_BS the other way round",
        pinhole("200, 200, 159.5, 119.5", "T_BS: [0,-1,0,0, 0,0,-1,0, 1,0,0,0, 0,0,0,1]\n"));
  all.push_back({"camera file", "opencv", "a calibration by OpenCV", Duty::read, [](SpoiltFlight &flight) {
                   flight.replace(kYaml, "%YAML:1.0\nimage_width: 320\nimage_height: 240\n"
                                         "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
                                         "   data: [ 200., 0., 159.5, 0., 200., 119.5, 0., 0., 1. ]\n");
                 }});
  return all;
}

/// One file in the place of the picture at the beginning of the fault.
Fault picture(const std::string &name, const std::string &what, const std::function<std::string(SpoiltFlight &)> &bytes)
{
  return {"picture files", name, what, Duty::survive,
          [=](SpoiltFlight &flight) { flight.setBytes(kAt, bytes(flight)); }};
}

/// Something that is no file in the place of the picture.
Fault thing(const std::string &name, const std::string &what, const std::function<void(const fs::path &)> &make)
{
  return {"picture files", name, what, Duty::survive, [=](SpoiltFlight &flight) {
            const std::string image = flight.camera.rows[kAt][1];
            flight.afterwards = [=](const fs::path &copy) {
              const fs::path path = copy / "mav0/cam0/data" / image;
              fs::remove(path);
              make(path);
            };
          }};
}

std::string encoded(const cv::Mat &image, const char *kind)
{
  std::vector<unsigned char> bytes;
  cv::imencode(kind, image, bytes);
  return {bytes.begin(), bytes.end()};
}

/// The same pixels, written otherwise.
Fault recoded(const std::string &name, const std::string &what, const std::function<cv::Mat(const cv::Mat &)> &change)
{
  return {"picture files", name, what, Duty::read, [=](SpoiltFlight &flight) {
            for (std::size_t i = 0; i < flight.frames(); ++i)
              flight.setBytes(i, encoded(change(flight.image(i)), ".png"));
          }};
}

std::vector<Fault> pictureFiles()
{
  const auto missing = [](std::size_t count) {
    return [count](SpoiltFlight &flight) {
      for (std::size_t i = kAt; i < kAt + count; ++i)
        flight.remove("mav0/cam0/data/" + flight.camera.rows[i][1]);
    };
  };
  return {
      {"picture files", "missing_1", "one that is not there", Duty::survive, missing(1)},
      {"picture files", "missing_20", "20 that are not there", Duty::survive, missing(20)},
      picture("empty", "one of no bytes", [](SpoiltFlight &) { return std::string(); }),
      picture("cut_png", "a PNG cut in the middle",
              [](SpoiltFlight &flight) {
                const std::string bytes = flight.bytesOf(kAt);
                return bytes.substr(0, bytes.size() / 2);
              }),
      picture("flipped_byte", "a PNG with one byte changed",
              [](SpoiltFlight &flight) {
                std::string bytes = flight.bytesOf(kAt);
                bytes[bytes.size() / 2] ^= 0x55;
                return bytes;
              }),
      picture("cut_jpeg", "a JPEG cut in the middle",
              [](SpoiltFlight &flight) {
                const std::string bytes = encoded(flight.image(kAt), ".jpg");
                return bytes.substr(0, bytes.size() / 2);
              }),
      picture("cut_tiff", "a TIFF cut in the middle",
              [](SpoiltFlight &flight) {
                const std::string bytes = encoded(flight.image(kAt), ".tiff");
                return bytes.substr(0, bytes.size() / 2);
              }),
      picture("small", "one of half the size",
              [](SpoiltFlight &flight) {
                cv::Mat small;
                cv::resize(flight.image(kAt), small, {}, 0.5, 0.5);
                return encoded(small, ".png");
              }),
      picture("huge", "a header of 30,000 x 30,000 px",
              [](SpoiltFlight &) { return std::string("P5 30000 30000 255\n"); }),
      picture("text", "a text", [](SpoiltFlight &) { return std::string("404 Not Found\n"); }),
      thing("fifo", "a pipe that nobody writes to", [](const fs::path &path) { mkfifo(path.c_str(), 0600); }),
      thing("device", "/dev/zero", [](const fs::path &path) { fs::create_symlink("/dev/zero", path); }),
      thing("folder", "a folder", [](const fs::path &path) { fs::create_directory(path); }),
      {"picture files", "jpeg", "all of them as JPEG under their old names", Duty::survive,
       [](SpoiltFlight &flight) {
         for (std::size_t i = 0; i < flight.frames(); ++i)
           flight.setBytes(i, encoded(flight.image(i), ".jpg"));
       }},
      recoded("colour", "all of them in colour",
              [](const cv::Mat &grey) {
                cv::Mat out;
                cv::cvtColor(grey, out, cv::COLOR_GRAY2BGR);
                return out;
              }),
      recoded("alpha", "all of them with a channel of transparency",
              [](const cv::Mat &grey) {
                cv::Mat out;
                cv::cvtColor(grey, out, cv::COLOR_GRAY2BGRA);
                return out;
              }),
      recoded("deep", "all of them with 16 bits",
              [](const cv::Mat &grey) {
                cv::Mat out;
                grey.convertTo(out, CV_16U, 257);
                return out;
              }),
      {"picture files", "stamp_twice", "two with one stamp", Duty::refuse,
       [](SpoiltFlight &flight) { flight.camera.rows[kAt][0] = flight.camera.rows[kAt - 1][0]; }, "data.csv:52"},
      {"picture files", "stamps_us", "stamps in microseconds", Duty::refuse,
       [](SpoiltFlight &flight) {
         for (SpoiltFlight::Row &row : flight.camera.rows)
           row[0] = std::to_string(std::stoll(row[0]) / 1000);
       },
       "must be in nanoseconds"},
  };
}

Fault option(const std::string &arguments, const std::string &says)
{
  return {"options", arguments, "", Duty::refuse, [](SpoiltFlight &) {}, says, arguments};
}

std::vector<Fault> options()
{
  return {
      option("--odometry-offset 1e30", "--odometry-offset"),
      option("--camera-height nan", "--camera-height"),
      option("--give-up -1", "--give-up"),
      option("--frames -1", "--frames"),
      option("--rate nan", "rate"),
      option("--max-width -3", "max_width"),
      option("--field-of-view 1e9", "field_of_view"),
      option("--set map.lag=nan", "map.lag"),
      option("--set trunks.radius=1e30", "trunks.radius"),
      option("--set detection.window=1e9", "detection.window"),
      option("--set trunks.radius_min=3", "trunks.radius_min"),
      option("--config /dev/zero", "/dev/zero"),
      option("--camera /none.yaml", "/none.yaml"),
  };
}
} // namespace

std::vector<Fault> fileFaults() { return joined({cameraFiles(), pictureFiles(), options()}); }
} // namespace bole::faults
