// SPDX-License-Identifier: GPL-2.0-or-later
// Each format is read back by a reader that shares no code with its writer; where Debian's own tools are installed,
// by those too.
#include "input/flight_folder.h"
#include "support/shell.h"
#include "support/test.h"

#include "exchange/exchange.h"
#include "geometry/so3.h"
#include "input/trajectory.h"
#include "output/flight_trace.h"
#include "output/summary_json.h"
#include "output/trunks_csv.h"
#include <bole/cylinder.h>
#include <bole/graph.h>
#include <nlohmann/json.hpp>
#include <visp3/mbt/vpMbGenericTracker.h>

namespace
{
using namespace bole;
using test::linesOf;
using testing::HasSubstr;
namespace fs = std::filesystem;

const Pose kBmc((Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished(), {0.1, 0, 0.02});

MapOfRun smallMap()
{
  MapOfRun map;
  map.name = "wood";
  map.bMc = kBmc;
  map.camera = {210, 211, 158.5, 121.25, 320, 240};
  for (int i = 0; i < 3; ++i) {
    TrunkRecord trunk;
    trunk.id = 4 + 3 * i;
    trunk.status = TrunkStatus::confirmed;
    trunk.xy = {4.0 + 2 * i, 1.5 - i};
    trunk.radius = 0.12 + 0.05 * i;
    trunk.lean = {0.02 * i, -0.01};
    trunk.ground_z = -1.5;
    trunk.probability = 0.9;
    trunk.covariance *= 1e-4;
    trunk.observations = 20;
    map.trunks.push_back(trunk);
  }
  for (int i = 0; i < 6; ++i)
    map.trajectory.push_back({1403636579763555584LL + i * 100000000LL,
                              Pose(expSo3({0.01 * i, -0.02 * i, 0.1 * i}), {0.4 * i, 0.03 * i, 0.01 * i})});
  return map;
}

/// The folder of a run that holds smallMap().
class Exported : public testing::Test
{
protected:
  Exported()
  {
    writeTrunks(m_run + "/trunks.csv", m_map.trunks);
    writeTrajectory(m_run + "/trajectory.tum", m_map.trajectory);
    RunSummary summary;
    summary.camera = m_map.camera;
    summary.frames[FrameStatus::ok] = m_map.trajectory.size();
    writeSummary(m_run + "/summary.json", summary);
    Graph graph;
    graph.bMc = kBmc;
    for (std::size_t i = 0; i < m_map.trajectory.size(); ++i) {
      graph.poses.push_back({static_cast<std::int64_t>(i), m_map.trajectory[i].wMb});
      if (i > 0)
        graph.odometry.push_back(
            {i - 1, i, {m_map.trajectory[i - 1].wMb.inverse() * m_map.trajectory[i].wMb, 1e-4 * Matrix6d::Identity()}});
    }
    graph.pose_priors.push_back({0, {graph.poses[0].wMb, 1e-4 * Matrix6d::Identity()}});
    writeG2o(m_run + "/graph.g2o", graph);
  }

  std::string path(const std::string &format, const std::optional<GeoOrigin> &origin = {}) const
  {
    const std::string file = m_run + "/out." + format;
    exportRun(m_run, format, file, origin);
    return file;
  }
  static std::vector<double> numbersOf(const std::string &line)
  {
    std::vector<double> numbers;
    std::istringstream stream(line);
    for (double number = 0; stream >> number;)
      numbers.push_back(number);
    return numbers;
  }

  const MapOfRun m_map = smallMap();
  test::TemporaryFolder m_folder;
  const std::string m_run = m_folder.path();
};

/// What \p tool of Debian's says of \p file; skips the test where it is not installed.
#define RUN_TOOL(outcome, tool, arguments)                                                                             \
  if (bole::test::runShell("command -v " tool).status != 0)                                                            \
    GTEST_SKIP() << tool " is not installed: read back by the test's own reader alone";                                \
  const bole::test::Outcome outcome = bole::test::runShell(tool " " + std::string(arguments))

TEST_F(Exported, CaoIsLoadedByViSPsGenericTracker)
{
  std::ostringstream silence;
  std::streambuf *out = std::cout.rdbuf(silence.rdbuf());
  vpMbGenericTracker visp;
  visp.setCameraParameters(m_map.camera.toVisp());
  visp.loadModel(path("cao"));
  std::cout.rdbuf(out);
  std::list<vpMbtDistanceCylinder *> cylinders;
  visp.getLcylinder(cylinders);
  ASSERT_EQ(cylinders.size(), 3u);
  std::size_t k = 0;
  for (vpMbtDistanceCylinder *cylinder : cylinders) {
    const Cylinder ours = cylinderOf(m_map.trunks[k++]);
    EXPECT_NEAR(cylinder->radius, ours.radius, 1e-5);
    EXPECT_NEAR(cylinder->p1->get_oX(), ours.foot.x(), 1e-5);
    EXPECT_NEAR(cylinder->p2->get_oZ(), ours.top.z(), 1e-5);
  }
}

TEST_F(Exported, PlyIsAMeshWhoseSidesStandRoundEachTrunk)
{
  const auto lines = linesOf(path("ply"));
  std::size_t vertices = 0, faces = 0, line = 0;
  ASSERT_EQ(lines[0], "ply");
  for (; lines[line] != "end_header"; ++line) {
    std::sscanf(lines[line].c_str(), "element vertex %zu", &vertices);
    std::sscanf(lines[line].c_str(), "element face %zu", &faces);
  }
  ASSERT_EQ(lines.size(), line + 1 + vertices + faces);
  std::vector<Eigen::Vector3d> points;
  for (std::size_t i = 0; i < vertices; ++i) {
    const auto n = numbersOf(lines[line + 1 + i]);
    ASSERT_EQ(n.size(), 6u);
    points.emplace_back(n[0], n[1], n[2]);
  }
  const std::size_t sides = faces / 3;
  for (std::size_t i = 0; i < faces; ++i) {
    const auto n = numbersOf(lines[line + 1 + vertices + i]);
    ASSERT_EQ(n.size(), 5u);
    ASSERT_EQ(n[0], 4);
    const TrunkRecord &trunk = m_map.trunks[i / sides];
    for (std::size_t k = 1; k < 5; ++k) {
      const Eigen::Vector3d &p = points.at(static_cast<std::size_t>(n[k]));
      const Eigen::Vector2d axis = trunk.xy + (p.z() - trunk.ground_z - kBreastHeight) * trunk.lean;
      EXPECT_NEAR((p.head<2>() - axis).norm(), trunk.radius, 2e-5);
    }
  }
  EXPECT_LT((points.back() - m_map.trajectory.back().wMb.t).norm(), 2e-5);
}

/// East, north of the tangent plane at the origin, by way of the earth's centre: exact, unlike toEarth().
Eigen::Vector2d eastNorth(const GeoOrigin &origin, double longitude, double latitude)
{
  const auto onEarth = [](double lat, double lon) {
    const double a = 6378137, f = 1 / 298.257223563, b = a * (1 - f);
    const double n = a * a / std::hypot(a * std::cos(lat), b * std::sin(lat));
    return Eigen::Vector3d(n * std::cos(lat) * std::cos(lon), n * std::cos(lat) * std::sin(lon),
                           n * b * b / (a * a) * std::sin(lat));
  };
  const double d = M_PI / 180, lat = origin.latitude * d, lon = origin.longitude * d;
  const Eigen::Vector3d off = onEarth(latitude * d, longitude * d) - onEarth(lat, lon);
  const Eigen::Vector3d east(-std::sin(lon), std::cos(lon), 0),
      north(-std::sin(lat) * std::cos(lon), -std::sin(lat) * std::sin(lon), std::cos(lat));
  return {east.dot(off), north.dot(off)};
}

TEST_F(Exported, GeoJsonPutsTheTrunksWhereTheOriginSays)
{
  const GeoOrigin origin{59.34, 18.07, 30};
  const auto json = nlohmann::json::parse(std::ifstream(path("geojson", origin)));
  ASSERT_EQ(json.at("features").size(), 4u);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto &feature = json["features"][i];
    const Eigen::Vector2d en = eastNorth(origin, feature["geometry"]["coordinates"][0].get<double>(),
                                         feature["geometry"]["coordinates"][1].get<double>());
    const double heading = 30 * M_PI / 180;
    const Eigen::Vector2d xy(en.x() * std::sin(heading) + en.y() * std::cos(heading),
                             -en.x() * std::cos(heading) + en.y() * std::sin(heading));
    EXPECT_LT((xy - m_map.trunks[i].xy).norm(), 1e-3);
    EXPECT_NEAR(feature["properties"]["dbh_cm"].get<double>(), 200 * m_map.trunks[i].radius, 0.01);
  }
  EXPECT_EQ(json["features"][3]["geometry"]["coordinates"].size(), m_map.trajectory.size());
}

TEST_F(Exported, TheEarthIsFlatEnoughWithinAFlight)
{
  const GeoOrigin origin{60, 25, 0};
  for (const Eigen::Vector2d &xy : {Eigen::Vector2d(350, 0), Eigen::Vector2d(0, 350), Eigen::Vector2d(-250, 240)}) {
    const Eigen::Vector2d degrees = toEarth(origin, xy), en = eastNorth(origin, degrees.x(), degrees.y());
    EXPECT_LT((en - Eigen::Vector2d(-xy.y(), xy.x())).norm(), 0.02); // north is x, west is y
  }
}

TEST_F(Exported, GeoJsonWithoutAnOriginHasMetresAndSaysSo)
{
  const auto json = nlohmann::json::parse(std::ifstream(path("geojson")));
  EXPECT_THAT(json.at("units").get<std::string>(), HasSubstr("metres"));
  EXPECT_NEAR(json["features"][1]["geometry"]["coordinates"][0].get<double>(), m_map.trunks[1].xy.x(), 1e-4);
  EXPECT_THAT(exportRun(m_run, "geojson", m_run + "/m.geojson", {}), HasSubstr("coordinates are metres"));
  EXPECT_EQ(exportRun(m_run, "geojson", m_run + "/m.geojson", GeoOrigin{59.34, 18.07, 30}), "");
  EXPECT_EQ(exportRun(m_run, "ply", m_run + "/m.ply", {}), "");
}

TEST_F(Exported, ADamagedSummaryIsNamedInPlainWords)
{
  for (const char *text : {"{\"scale\": 5}", "{\"ranges\": \"no\"}", "{}"}) {
    std::ofstream(m_run + "/summary.json") << text;
    EXPECT_THAT(test::messageOf([&] { readMapOfRun(m_run); }),
                testing::AllOf(HasSubstr("summary.json: is damaged: "), testing::Not(HasSubstr("json.exception"))))
        << text;
  }
}

TEST_F(Exported, GeoJsonIsReadByGdal)
{
  RUN_TOOL(outcome, "ogrinfo", "-al -ro " + path("geojson", GeoOrigin{59.34, 18.07, 30}));
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("Feature Count: 4"));
  EXPECT_THAT(outcome.text, HasSubstr("WGS 84"));
}

TEST(Origin, IsRefusedWhenItIsNone)
{
  for (const char *text : {"", "59.3", "59.3,18.1", "59.3,18.1,north", "91,0,0", "nan,0,0", "1,2,3,4", "1;2;3"})
    EXPECT_THROW(parseOrigin(text), vpException) << text;
  EXPECT_EQ(parseOrigin("-12.5,130,-90").heading, -90);
}

/// Group codes and values of a DXF file.
std::vector<std::pair<int, std::string>> groupsOf(const std::vector<std::string> &lines)
{
  std::vector<std::pair<int, std::string>> groups;
  for (std::size_t i = 0; i + 1 < lines.size(); i += 2)
    groups.emplace_back(std::stoi(lines[i]), lines[i + 1]);
  return groups;
}

TEST_F(Exported, DxfHasACircleATrunkAndALineForTheTrajectory)
{
  const auto lines = linesOf(path("dxf"));
  ASSERT_EQ(lines.size() % 2, 0u);
  std::vector<std::map<int, std::string>> circles, vertices;
  std::map<int, std::string> *entity = nullptr, other;
  for (const auto &[code, value] : groupsOf(lines)) {
    if (code == 0) {
      auto *kind = value == "CIRCLE" ? &circles : value == "VERTEX" ? &vertices : nullptr;
      entity = kind != nullptr ? &kind->emplace_back() : &other;
    }
    else if (entity != nullptr)
      (*entity)[code] = value;
  }
  ASSERT_EQ(circles.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(std::stod(circles[i].at(10)), m_map.trunks[i].xy.x(), 1e-5);
    EXPECT_NEAR(std::stod(circles[i].at(20)), m_map.trunks[i].xy.y(), 1e-5);
    EXPECT_NEAR(std::stod(circles[i].at(40)), m_map.trunks[i].radius, 1e-5);
  }
  ASSERT_EQ(vertices.size(), m_map.trajectory.size());
  EXPECT_NEAR(std::stod(vertices[5].at(10)), m_map.trajectory[5].wMb.t.x(), 1e-5);
  EXPECT_EQ(lines[lines.size() - 1], "EOF");
}

TEST_F(Exported, DxfIsReadByGdal)
{
  RUN_TOOL(outcome, "ogrinfo", "-al -ro " + path("dxf"));
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("Layer (String) = TRUNKS"));
  EXPECT_THAT(outcome.text, HasSubstr("Feature Count: 7")); // circles, labels, the trajectory
}

TEST_F(Exported, TheForestersTableHasDiametersInCentimetres)
{
  const auto lines = linesOf(path("csv"));
  ASSERT_EQ(lines.size(), 4u);
  EXPECT_THAT(lines[0], testing::StartsWith("tree,x_m,y_m,position_sigma_m,dbh_cm"));
  EXPECT_THAT(lines[2], testing::StartsWith("7,6.000,0.500,0.014,34.0,2.0,0.0908,"));
}

TEST_F(Exported, TumHasThePosesToNineDecimals)
{
  const auto lines = linesOf(path("tum"));
  ASSERT_EQ(lines.size(), 1 + m_map.trajectory.size());
  const auto n = numbersOf(lines[6]);
  ASSERT_EQ(n.size(), 8u);
  EXPECT_EQ(lines[6].substr(0, lines[6].find(' ')), "1403636580.263555584");
  const Pose &wMb = m_map.trajectory[5].wMb;
  EXPECT_LT((Eigen::Vector3d(n[1], n[2], n[3]) - wMb.t).norm(), 2e-9);
  EXPECT_LT((Eigen::Quaterniond(n[7], n[4], n[5], n[6]).toRotationMatrix() - wMb.R).norm(), 1e-8);
}

TEST_F(Exported, ColmapProjectsWhatOurCameraProjects)
{
  const std::string folder = path("colmap");
  const auto cameras = linesOf(folder + "/cameras.txt"), images = linesOf(folder + "/images.txt"),
             points = linesOf(folder + "/points3D.txt");
  ASSERT_THAT(cameras.at(1), testing::StartsWith("1 PINHOLE 320 240 "));
  const auto f = numbersOf(cameras[1].substr(std::string("1 PINHOLE ").size()));
  ASSERT_EQ(images.size(), 2 + 2 * m_map.trajectory.size());
  const auto q = numbersOf(images[2 + 2 * 3].substr(0, images[2 + 2 * 3].rfind(' ')));
  const auto p = numbersOf(points.at(100));
  ASSERT_EQ(q.size(), 9u);
  ASSERT_EQ(p.size(), 8u);
  const Eigen::Vector3d point(p[1], p[2], p[3]);
  // COLMAP: x_camera = R(q) x_world + t; the middle of the first pixel is (0.5, 0.5)
  const Eigen::Vector3d c = Eigen::Quaterniond(q[1], q[2], q[3], q[4]) * point + Eigen::Vector3d(q[5], q[6], q[7]);
  const Eigen::Vector2d theirs(f[2] * c.x() / c.z() + f[4], f[3] * c.y() / c.z() + f[5]);
  const Eigen::Vector2d ours = m_map.camera.project((m_map.trajectory[3].wMb * kBmc).inverse() * point);
  EXPECT_GT(c.z(), 0);
  EXPECT_LT((theirs - Eigen::Vector2d(0.5, 0.5) - ours).norm(), 1e-4);
  EXPECT_THAT(images[2 + 2 * 3], testing::EndsWith(" 1 1403636580063555584.png"));
}

TEST_F(Exported, ColmapHasTheNamesAndTheLensOfThePicturesThatAreThere)
{
  const test::FlightFolder flight(6);
  flight.write("mav0/cam0/sensor.yaml", "resolution: [64, 48]\nintrinsics: [50, 51, 31.5, 23.5]\n"
                                        "distortion_model: equidistant\ndistortion_coefficients: [0.01, 0.02, 0, 0]\n");
  RunSummary summary;
  summary.camera = m_map.camera;
  summary.working_folder = "/";
  summary.input = flight.path();
  summary.frames[FrameStatus::ok] = m_map.trajectory.size();
  writeSummary(m_run + "/summary.json", summary);
  FlightTrace trace;
  for (std::size_t i = 0; i < m_map.trajectory.size(); ++i) {
    trace.frames.emplace_back();
    trace.frames.back().index = i;
    trace.frames.back().stamp_ns = m_map.trajectory[i].stamp_ns;
  }
  writeTrace(m_run, trace);
  const std::string folder = m_run + "/colmap";
  EXPECT_EQ(exportRun(m_run, "colmap", folder, {}), "");
  EXPECT_EQ(linesOf(folder + "/cameras.txt").at(1), "1 OPENCV_FISHEYE 64 48 50 51 32 24 0.01 0.02 0 0");
  EXPECT_THAT(linesOf(folder + "/images.txt").at(2 + 2 * 3), testing::EndsWith(" 1 0003.png"));
}

TEST_F(Exported, AModelOfColmapsOwnStays)
{
  const std::string folder = m_run + "/model";
  fs::create_directories(folder);
  std::ofstream(folder + "/cameras.txt") << "# Camera list with one line of data per camera:\n";
  EXPECT_THROW(exportRun(m_run, "colmap", folder, {}), vpException);
  EXPECT_FALSE(fs::exists(folder + "/images.txt"));
}

TEST_F(Exported, ColmapIsReadByColmap)
{
  setenv("QT_QPA_PLATFORM", "offscreen", 1);
  RUN_TOOL(outcome, "colmap", "model_analyzer --path " + path("colmap"));
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("Registered images: 6"));
  EXPECT_THAT(outcome.text, HasSubstr("Points: 1872"));
}

TEST_F(Exported, G2oHasPosesAndEdgesOfG2osOwnTags)
{
  std::map<int, Eigen::Isometry3d> poses;
  int edges = 0;
  for (const std::string &line : linesOf(path("g2o"))) {
    std::istringstream stream(line);
    std::string tag;
    stream >> tag;
    std::vector<int> ids(tag == "VERTEX_SE3:QUAT" ? 1 : tag == "EDGE_SE3:QUAT" ? 2 : 0);
    if (ids.empty())
      continue;
    for (int &id : ids)
      stream >> id;
    double t[3], q[4];
    for (double *numbers : {t, t + 1, t + 2, q, q + 1, q + 2, q + 3})
      stream >> *numbers;
    ASSERT_FALSE(stream.fail());
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translate(Eigen::Vector3d(t[0], t[1], t[2])).rotate(Eigen::Quaterniond(q[3], q[0], q[1], q[2]));
    if (ids.size() == 1)
      poses[ids[0]] = pose;
    else { // g2o's error of an edge: measurement^-1 (a^-1 b), here made to be none
      EXPECT_TRUE((pose.inverse() * poses.at(ids[0]).inverse() * poses.at(ids[1]))
                      .isApprox(Eigen::Isometry3d::Identity(), 1e-9));
      ++edges;
    }
  }
  EXPECT_EQ(poses.size(), 6u);
  EXPECT_EQ(edges, 5);
}

TEST_F(Exported, ARunThatOnlyRotatedIsRefused)
{
  RunSummary summary;
  summary.reference.has_ranges = false;
  writeSummary(m_run + "/summary.json", summary);
  EXPECT_THROW(path("cao"), vpException);
}

TEST_F(Exported, AMapWithoutTrunksIsRefused)
{
  writeTrunks(m_run + "/trunks.csv", {});
  EXPECT_REFUSED("no trunk", path("dxf"));
}
} // namespace
