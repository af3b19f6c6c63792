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
      camera("yaml_cycle", "", "holds itself by an alias", "a: &a [1, *a]\n"),
      camera("yaml_bomb", "", "aliases make more than 100000 entries", aliasBomb()),
      camera("yaml_deep", "by 100,000 brackets", "nested deeper than 32", std::string(100'000, '[')),
      camera("focal_1e-9", "", "sensor.yaml:2: intrinsics: fx = 1e-09 px", pinhole("1.0e-9, 1.0e-9, 160, 120")),
      camera("focal_1e9", "", "sensor.yaml:2: intrinsics: fx = 1e+09 px", pinhole("1.0e+9, 1.0e+9, 160, 120")),
      camera("focal_apart", "", "fx / fy = 0.1, must be 0.5 to 2", pinhole("200, 2000, 160, 120")),
      camera("centre_outside", "", "principal point (400, 120) must be in the picture", pinhole("200, 200, 400, 120")),
      camera("lens_1e300", "", "sensor.yaml:4: distortion_coefficients: the distortion folds the picture",
             pinhole("200, 200, 160, 120", lens)),
      camera("arm_1e9", "", "T_BS: the camera is 1e+09 m from the body",
             pinhole("200, 200, 160, 120", "T_BS: [0,0,1,1.0e+9, -1,0,0,0, 0,-1,0,0, 0,0,0,1]\n")),
      camera("no_rotation", "", "T_BS: no rotation in the body",
             pinhole("200, 200, 160, 120", "T_BS: [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n")),
      camera("other_size", "", "must be 640x480", "resolution: [640, 480]\nintrinsics: [400, 400, 319.5, 239.5]\n"),
  };
  const auto wrong = [&all](const std::string &name, const std::string &what, const std::string &text) {
    all.push_back(fromTheFirst(
        {"camera file", name, what, Duty::survive, [=](SpoiltFlight &flight) { flight.replace(kYaml, text); }}));
  };
  wrong("focal_5_short", "by 5 %", pinhole("190, 190, 159.5, 119.5"));
  wrong("focal_10_long", "by 10 %", pinhole("220, 220, 159.5, 119.5"));
  wrong("focal_twice", "", pinhole("400, 400, 159.5, 119.5"));
  wrong("focal_unequal", "by 25 %", pinhole("200, 150, 159.5, 119.5"));
  wrong("centre_swapped", "with the focal lengths", pinhole("159.5, 119.5, 200, 200"));
  wrong("arm_pitched", "by 10 degrees",
        pinhole("200, 200, 159.5, 119.5",
                "T_BS: [0,-0.173648,0.984808,0, -1,0,0,0, 0,-0.984808,-0.173648,0, 0,0,0,1]\n"));
  wrong("arm_inverse", "", pinhole("200, 200, 159.5, 119.5", "T_BS: [0,-1,0,0, 0,0,-1,0, 1,0,0,0, 0,0,0,1]\n"));
  all.push_back({"camera file", "opencv", "calibration", Duty::read, [](SpoiltFlight &flight) {
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
      {"picture files", "missing_1", "", Duty::survive, missing(1)},
      {"picture files", "missing_20", "", Duty::survive, missing(20)},
      picture("empty", "", [](SpoiltFlight &) { return std::string(); }),
      picture("cut_png", "",
              [](SpoiltFlight &flight) {
                const std::string bytes = flight.bytesOf(kAt);
                return bytes.substr(0, bytes.size() / 2);
              }),
      picture("flipped_byte", "",
              [](SpoiltFlight &flight) {
                std::string bytes = flight.bytesOf(kAt);
                bytes[bytes.size() / 2] ^= 0x55;
                return bytes;
              }),
      picture("cut_jpeg", "",
              [](SpoiltFlight &flight) {
                const std::string bytes = encoded(flight.image(kAt), ".jpg");
                return bytes.substr(0, bytes.size() / 2);
              }),
      picture("cut_tiff", "",
              [](SpoiltFlight &flight) {
                const std::string bytes = encoded(flight.image(kAt), ".tiff");
                return bytes.substr(0, bytes.size() / 2);
              }),
      picture("small", "by half",
              [](SpoiltFlight &flight) {
                cv::Mat small;
                cv::resize(flight.image(kAt), small, {}, 0.5, 0.5);
                return encoded(small, ".png");
              }),
      picture("huge", "by its header", [](SpoiltFlight &) { return std::string("P5 30000 30000 255\n"); }),
      picture("text", "", [](SpoiltFlight &) { return std::string("404 Not Found\n"); }),
      thing("fifo", "without a writer", [](const fs::path &path) { mkfifo(path.c_str(), 0600); }),
      thing("device", "/dev/zero", [](const fs::path &path) { fs::create_symlink("/dev/zero", path); }),
      thing("folder", "", [](const fs::path &path) { fs::create_directory(path); }),
      {"picture files", "jpeg", "in all, as .png", Duty::survive,
       [](SpoiltFlight &flight) {
         for (std::size_t i = 0; i < flight.frames(); ++i)
           flight.setBytes(i, encoded(flight.image(i), ".jpg"));
       }},
      recoded("colour", "in all",
              [](const cv::Mat &grey) {
                cv::Mat out;
                cv::cvtColor(grey, out, cv::COLOR_GRAY2BGR);
                return out;
              }),
      recoded("alpha", "in all",
              [](const cv::Mat &grey) {
                cv::Mat out;
                cv::cvtColor(grey, out, cv::COLOR_GRAY2BGRA);
                return out;
              }),
      recoded("deep", "(16 bits) in all",
              [](const cv::Mat &grey) {
                cv::Mat out;
                grey.convertTo(out, CV_16U, 257);
                return out;
              }),
      {"picture files", "stamp_twice", "", Duty::refuse,
       [](SpoiltFlight &flight) { flight.camera.rows[kAt][0] = flight.camera.rows[kAt - 1][0]; },
       "data.csv:52: timestamp = 4900000000 ns, must be later"},
      {"picture files", "stamps_us", "", Duty::refuse,
       [](SpoiltFlight &flight) {
         for (SpoiltFlight::Row &row : flight.camera.rows)
           row[0] = std::to_string(std::stoll(row[0]) / 1000);
       },
       "stamps must be in nanoseconds"},
  };
}

Fault option(const std::string &arguments, const std::string &says)
{
  return {"options", arguments, "", Duty::refuse, [](SpoiltFlight &) {}, says, arguments};
}

std::vector<Fault> options()
{
  return {
      option("--odometry-offset 1e30", "must be in [-1e+10, 1e+10]"),
      option("--camera-height nan", "must be in [0.1, 100]"),
      option("--give-up -1", "must be in [0.1, 86400]"),
      option("--frames -1", "must be in [0, 1e+09]"),
      option("--rate nan", "must be in [0.001, 10000]"),
      option("--max-width -3", "must be in [64, 16384]"),
      option("--field-of-view 1e9", "must be in [10, 150]"),
      option("--set map.lag=nan", "must be a number in [0, 100000]"),
      option("--set trunks.radius=1e30", "must be a number in [0.001, 10]"),
      option("--set detection.window=1e9", "must be a whole number in [4, 100]"),
      option("--set trunks.radius_min=3", "must be a number in [0.005, trunks.radius_max = 0.6]"),
      option("--config /dev/zero", "is a pipe, socket or device"),
      option("--camera /none.yaml", "no such file"),
  };
}
} // namespace

std::vector<Fault> fileFaults() { return joined({cameraFiles(), pictureFiles(), options()}); }
} // namespace bole::faults
