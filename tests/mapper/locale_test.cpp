// SPDX-License-Identifier: GPL-2.0-or-later
// A host program whose decimals have a comma reads and writes the same bytes.
#include "support/test.h"

#include "exchange/exchange.h"
#include "input/recorded_source.h"
#include "input/trajectory.h"
#include "mbt/model_files.h"
#include "output/flight_trace.h"
#include "output/summary_json.h"
#include "output/trunks_csv.h"
#include <bole/config.h>
#include <bole/graph.h>
#include <bole/pipeline.h>
#include <clocale>
#include <locale>

namespace
{
using namespace bole;
namespace fs = std::filesystem;

/// Sets the locale of C and of C++ to German while it lives; the locale is made where the system has none.
class GermanLocale
{
public:
  GermanLocale()
  {
    const std::string make =
        "localedef -i de_DE -f UTF-8 --no-archive " + m_folder.path() + "/de_DE.UTF-8 >/dev/null 2>&1";
    static_cast<void>(std::system(make.c_str()));
    setenv("LOCPATH", m_folder.path().c_str(), 1);
    try {
      std::locale::global(std::locale("de_DE.UTF-8")); // sets that of C, too
    }
    catch (const std::runtime_error &) {
    }
  }
  ~GermanLocale()
  {
    std::locale::global(std::locale::classic());
    unsetenv("LOCPATH");
  }
  GermanLocale(const GermanLocale &) = delete;
  GermanLocale &operator=(const GermanLocale &) = delete;

  /// Whether decimals have a comma now: false where the locale could not be made.
  static bool isOn() { return std::string(std::localeconv()->decimal_point) == ","; }

private:
  test::TemporaryFolder m_folder;
};

class Locales : public testing::Test
{
protected:
  std::string write(const std::string &name, const std::string &text) const { return m_folder.write(name, text); }

  /// Files of a short flight, mapped here and now.
  std::map<std::string, std::string> filesOfAFlight(const std::string &name) const
  {
    const std::string run = m_folder / name;
    fs::create_directories(run);
    Options options;
    readConfig(write("options.yaml", "odometry:\n  height: 0.125\n"), options);
    AslSource source(BOLE_SOURCE_DIR "/data/park-forward");
    Pipeline pipeline(source.camera(), source.bMc(), options);
    Frame frame;
    for (int k = 0; k < 40 && source.next(frame); ++k)
      pipeline.process(frame);
    pipeline.finish();
    RunSummary summary;
    summary.camera = source.camera();
    summary.options = toYaml(options);
    summary.path_m = 1234.5;
    writeSummary(run + "/summary.json", summary);
    std::vector<TrunkRecord> trunks = pipeline.map();
    for (TrunkRecord &trunk : trunks)
      trunk.status = TrunkStatus::confirmed;
    writeTrunks(run + "/trunks.csv", trunks);
    writeTrajectory(run + "/trajectory.tum", pipeline.smoothedTrajectory());
    writeG2o(run + "/graph.g2o", pipeline.graph());
    std::map<std::string, std::string> files;
    const std::vector<Cylinder> many(600);
    writeCao(run + "/many.cao", many);
    for (const auto &entry : fs::directory_iterator(run))
      files[entry.path().filename().string()] = test::textOf(entry.path());
    return files;
  }

  test::TemporaryFolder m_folder;
};

TEST_F(Locales, AFlightIsMappedToTheSameBytes)
{
  const auto here = filesOfAFlight("here");
  EXPECT_GE(here.size(), 4u);
  const GermanLocale german;
  if (!german.isOn())
    GTEST_SKIP() << "no German locale, and localedef cannot make it";
  for (const auto &[name, bytes] : filesOfAFlight("there"))
    EXPECT_EQ(bytes, here.at(name)) << name;
}

TEST_F(Locales, FilesOfOthersAreReadAlike)
{
  const GermanLocale german;
  if (!german.isOn())
    GTEST_SKIP() << "no German locale, and localedef cannot make it";
  EXPECT_EQ(readCamera(write("c.yaml", "resolution: [320, 240]\nintrinsics: [200.5, 201.25, 160.5, 120.5]\n"))
                .model.pinhole.fx,
            200.5);
  const std::string model = "<type>perspectiveProjWithDistortion</type><px>200.5</px><py>201.25</py><u0>160.5</u0>"
                            "<v0>120.5</v0><kud>-0.125</kud>";
  const CameraModel xml =
      readCamera(write("c.xml", "<root><camera><model>" + model + "</model></camera></root>"), 320, 240).model;
  EXPECT_EQ(xml.pinhole.fy, 201.25);
  EXPECT_EQ(xml.coefficients[0], -0.125);
  EXPECT_EQ(readTrunkSettings(write("t.xml", "<conf><trunk><radius_sigma>0.125</radius_sigma></trunk></conf>"), {})
                .options.radius_sigma,
            0.125);
  EXPECT_EQ(readCao(write("m.cao", "V1\n2\n0.5 0 0\n0.5 0 3\n0\n0\n0\n1\n0 1 0.125\n0\n"))[0].radius, 0.125);
  EXPECT_EQ(readTrajectory(write("o.tum", "1.5 0.25 0 1 0 0 0 1\n"))[0].wMb.t.x(), 0.25);
  EXPECT_EQ(parseOrigin("59.25,18.5,0.5").longitude, 18.5);
  EXPECT_EQ(readG2o(write("g.g2o", "VERTEX_SE3:QUAT 0 0.5 0 0 0 0 0 1\n")).poses[0].wMb.t.x(), 0.5);
}
} // namespace
