// SPDX-License-Identifier: GPL-2.0-or-later
// The fuzz targets of tests/fuzz over damaged good inputs: seconds of what the fuzzers do for minutes. A target that
// finds something aborts.
#include "ardrone/files.h"
#include "support/flight.h"
#include "support/test.h"

#include "ardrone/drone_link.h"
#include "ardrone/flight_folder.h"
#include "ardrone/navdata_odometry.h"
#include "ardrone/uvlc.h"
#include "ardrone/video_decoder.h"
#include "emulator/emulator_packets.h"
#include "emulator/wire_format.h"
#include "output/video_writer.h"
#include <bole/graph.h>
#include <opencv2/imgcodecs.hpp>
#include <visp3/core/vpImageConvert.h>

extern "C" {
int fuzz_camera(const std::uint8_t *data, std::size_t size);
int fuzz_cao(const std::uint8_t *data, std::size_t size);
int fuzz_g2o(const std::uint8_t *data, std::size_t size);
int fuzz_image(const std::uint8_t *data, std::size_t size);
int fuzz_navdata(const std::uint8_t *data, std::size_t size);
int fuzz_options(const std::uint8_t *data, std::size_t size);
int fuzz_pave(const std::uint8_t *data, std::size_t size);
int fuzz_recording(const std::uint8_t *data, std::size_t size);
int fuzz_tables(const std::uint8_t *data, std::size_t size);
int fuzz_uvlc(const std::uint8_t *data, std::size_t size);
int fuzz_video(const std::uint8_t *data, std::size_t size);
}

namespace
{
using namespace bole;
using Bytes = std::vector<std::uint8_t>;

std::size_t below(std::mt19937 &random, std::size_t end)
{
  return std::uniform_int_distribution<std::size_t>(0, end - 1)(random);
}

/// \p bytes with one to eight faults: changed, cut out, doubled, lengths of extreme size.
Bytes damaged(Bytes bytes, std::mt19937 &random)
{
  for (std::size_t faults = 1 + below(random, 8); faults > 0 && !bytes.empty(); --faults) {
    const std::size_t at = below(random, bytes.size());
    const std::size_t length = std::min(bytes.size() - at, 1 + below(random, 64));
    const auto from = bytes.begin() + static_cast<std::ptrdiff_t>(at);
    const auto to = from + static_cast<std::ptrdiff_t>(length);
    switch (below(random, 4)) {
    case 0:
      *from ^= static_cast<std::uint8_t>(1 + below(random, 255));
      break;
    case 1:
      bytes.erase(from, to);
      break;
    case 2: {
      const Bytes piece(from, to);
      bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(below(random, bytes.size() + 1)), piece.begin(),
                   piece.end());
      break;
    }
    default:
      std::fill(from, std::min(to, from + 4), static_cast<std::uint8_t>(below(random, 2) ? 0xff : 0));
    }
  }
  return bytes;
}

/// For libFuzzer to start from: the good inputs as files of BOLE_FUZZ_SEEDS/\p name, when that is set.
void keepSeeds(const std::string &name, const std::vector<Bytes> &good)
{
  const char *folder = std::getenv("BOLE_FUZZ_SEEDS");
  if (folder == nullptr)
    return;
  const std::filesystem::path path = std::filesystem::path(folder) / name;
  std::filesystem::create_directories(path);
  for (std::size_t i = 0; i < good.size(); ++i)
    std::ofstream(path / std::to_string(i), std::ios::binary)
        .write(reinterpret_cast<const char *>(good[i].data()), static_cast<std::streamsize>(good[i].size()));
}

void expectSurvives(const std::string &name, int (*target)(const std::uint8_t *, std::size_t),
                    const std::vector<Bytes> &good, int runs)
{
  keepSeeds(name, good);
  std::mt19937 random(1);
  for (const Bytes &bytes : good)
    EXPECT_EQ(target(bytes.data(), bytes.size()), 0);
  for (int i = 0; i < runs; ++i) {
    const Bytes bytes = damaged(good[below(random, good.size())], random);
    EXPECT_EQ(target(bytes.data(), bytes.size()), 0);
  }
}

/// Adds a file from a real drone, where it is on this machine.
void addCaptured(std::vector<Bytes> &good, const std::string &name, std::size_t most)
{
  Bytes bytes = test::captured(name);
  bytes.resize(std::min(bytes.size(), most));
  if (!bytes.empty())
    good.push_back(std::move(bytes));
}

Bytes bytesOf(const std::string &path, std::size_t most = 1 << 20)
{
  const std::string text = test::textOf(path);
  EXPECT_FALSE(text.empty()) << path;
  Bytes bytes(text.begin(), text.end());
  bytes.resize(std::min(bytes.size(), most));
  return bytes;
}

/// The target of camera files reads XML where the first byte says so.
Bytes withKind(std::uint8_t kind, Bytes bytes)
{
  bytes.insert(bytes.begin(), kind);
  return bytes;
}

Bytes paveStream()
{
  VideoPacketEncoder encoder({160, 128, 20, 4e5, false, 4, ""});
  Bytes stream = {12}; // the target cuts the rest into pieces of 97 bytes
  for (int i = 0; i < 6; ++i) {
    const auto encoded = encoder.encode(test::stripes(160, 128, i), i == 0);
    PaveHeader header;
    header.frame_number = static_cast<std::uint32_t>(i + 1);
    header.timestamp_ms = static_cast<std::uint32_t>(50 * i);
    header.display_width = 160;
    header.display_height = 128;
    const Bytes frame = paveFrame(encoder, encoded, header);
    stream.insert(stream.end(), frame.begin(), frame.end());
  }
  return stream;
}
} // namespace

TEST(FuzzTargets, DamagedNavdata)
{
  Navdata navdata;
  navdata.sequence = 7;
  navdata.time = 1234567;
  navdata.demo = Navdata::Demo{};
  navdata.physical = Navdata::Physical{};
  std::vector<Bytes> good = {encodeNavdata(navdata)};
  addCaptured(good, "navdata.bin", 1 << 16);
  expectSurvives("navdata", fuzz_navdata, good, 10000);
}

TEST(FuzzTargets, DamagedPaveStreams)
{
  std::vector<Bytes> good = {paveStream()};
  addCaptured(good, "pave.bin", 40'000);
  expectSurvives("pave", fuzz_pave, good, 300);
}

TEST(FuzzTargets, DamagedUvlcPictures)
{
  expectSurvives("uvlc", fuzz_uvlc,
                 {encodeUvlc(test::stripes(88, 72, 0), 1), encodeUvlc(test::stripes(160, 120, 3), 2)}, 1500);
}

TEST(FuzzTargets, DamagedRecordingsAndCommands)
{
  const test::TemporaryFolder folder;
  {
    RecordingWriter writer(folder.path());
    for (int i = 0; i < 20; ++i) {
      const Bytes bytes(static_cast<std::size_t>(10 + 13 * i), static_cast<std::uint8_t>(i));
      writer.write(i % 2 ? LinkChannel::video : LinkChannel::navdata, 1000 * i, bytes.data(), bytes.size());
    }
  }
  const Bytes recording = bytesOf(folder / "raw.bin");
  ASSERT_GT(recording.size(), 1000u);
  const std::string text =
      "AT*CONFIG=1,\"general:navdata_demo\",\"FALSE\"\rAT*CTRL=2,5,0\rAT*PCMD=3,1,0,-1085485875,0,0\r";
  expectSurvives("recording", fuzz_recording, {recording, Bytes(text.begin(), text.end())}, 10000);
}

TEST(FuzzTargets, DamagedGraphs)
{
  test::FlightOptions options{8};
  const test::Flight flight = test::simulateFlight(options);
  test::Replay replay(flight, test::smootherFor(options));
  replay.run();
  std::stringstream out;
  writeG2o(out, replay.smoother.graph());
  const std::string text = out.str();
  ASSERT_GT(text.size(), 1000u);
  expectSurvives("g2o", fuzz_g2o, {Bytes(text.begin(), text.end())}, 1500);
}

TEST(FuzzTargets, DamagedCameraFiles)
{
  const std::string root = BOLE_SOURCE_DIR;
  const std::string opencv =
      "1image_width: 320\nimage_height: 240\ncamera_matrix: {rows: 3, cols: 3, data: [200, 0, 160, "
      "0, 201, 120, 0, 0, 1]}\ndistortion_coefficients: [-0.2, 0.05, 0, 0, 0.01]\n";
  const std::string xml = "0<root><camera><name>c</name><image_width>320</image_width><image_height>240</image_height>"
                          "<model><type>perspectiveProjWithoutDistortion</type><px>200</px><py>200</py><u0>160</u0>"
                          "<v0>120</v0></model></camera></root>";
  expectSurvives("camera", fuzz_camera,
                 {withKind(1, bytesOf(root + "/data/park-forward/mav0/cam0/sensor.yaml")),
                  withKind(1, bytesOf(root + "/config/cameras/ardrone1.yaml")), Bytes(opencv.begin(), opencv.end()),
                  withKind(0, Bytes(xml.begin() + 1, xml.end()))},
                 4000);
}

TEST(FuzzTargets, DamagedOptions)
{
  const std::string config = std::string(BOLE_SOURCE_DIR) + "/config";
  expectSurvives("options", fuzz_options, {bytesOf(config + "/default.yaml"), bytesOf(config + "/ardrone1.yaml")},
                 1500);
}

TEST(FuzzTargets, DamagedTables)
{
  const std::string flight = std::string(BOLE_SOURCE_DIR) + "/data/park-forward/";
  const std::string tum = "# time x y z qx qy qz qw\n0.1 0 0 1 0 0 0 1\n0.2 0.1 0 1 0 0 0 1\n3.5e-1 1 0 1 0 0 0 1\n";
  expectSurvives("tables", fuzz_tables,
                 {bytesOf(flight + "mav0/odom0/data.csv", 2000), bytesOf(flight + "trees.csv", 1000),
                  Bytes(tum.begin(), tum.end())},
                 4000);
}

TEST(FuzzTargets, DamagedModels)
{
  expectSurvives("cao", fuzz_cao, {bytesOf(std::string(BOLE_SOURCE_DIR) + "/models/park-forward.cao", 3000)}, 4000);
}

TEST(FuzzTargets, DamagedImages)
{
  std::vector<Bytes> good;
  const vpImage<unsigned char> I = test::stripes(64, 48, 0);
  const cv::Mat image(48, 64, CV_8UC1, I.bitmap);
  for (const char *kind : {".png", ".jpg", ".pgm", ".bmp", ".tiff"}) {
    good.emplace_back();
    cv::imencode(kind, image, good.back());
  }
  expectSurvives("image", fuzz_image, good, 6000);
}

TEST(FuzzTargets, DamagedVideos)
{
  const test::TemporaryFolder folder;
  const std::string path = folder / "video.mp4";
  {
    VideoWriter writer(path);
    vpImage<vpRGBa> colour;
    for (int i = 0; i < 12; ++i) {
      vpImageConvert::convert(test::stripes(96, 64, i), colour);
      writer.write(colour, 100'000'000LL * i);
    }
    writer.finish();
  }
  expectSurvives("video", fuzz_video, {bytesOf(path)}, 150);
}
