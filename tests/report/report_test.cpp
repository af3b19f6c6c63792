// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/best_view.h"
#include "report/report_drawings.h"
#include "report/report_page.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>

namespace
{
using namespace bole;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

TrunkRecord trunkOf(int id, TrunkStatus status = TrunkStatus::confirmed)
{
  TrunkRecord trunk;
  trunk.id = id;
  trunk.status = status;
  trunk.xy = {4, 0.5 * id};
  trunk.radius = 0.2;
  trunk.covariance *= 1e-4;
  return trunk;
}

RunRecord smallRun()
{
  RunRecord run;
  run.folder = "run";
  run.input = "a <drawn> flight";
  run.facts = {"path 3 m"};
  run.trunks = {trunkOf(1), trunkOf(2), trunkOf(3, TrunkStatus::candidate), trunkOf(4, TrunkStatus::lost)};
  run.timing.stages = {"gradient"};
  for (int i = 0; i < 30; ++i) {
    const std::int64_t stamp_ns = i * 100000000LL;
    const auto index = static_cast<std::size_t>(i);
    run.smoothed.push_back({stamp_ns, Pose(Eigen::Matrix3d::Identity(), {0.1 * i, 0, 0})});
    run.trace.frames.push_back({index,
                                stamp_ns,
                                i == 7 ? FrameStatus::corrupt : FrameStatus::ok,
                                {0.1 * i, 0, 0},
                                1e-4 * Eigen::Matrix2d::Identity()});
    run.trace.views.push_back({index, stamp_ns, 1, 4 - 0.1 * i, 0.1, 0.21, 0.01, {4, 0.5}, {0.05, 0.02}});
    run.timing.frames.push_back({index, stamp_ns, {1.5}, 2.5, {}});
  }
  run.trace.evidence.add({4.02, 0.5, 1}, 5);
  run.views_jpeg[1] = "picture";
  return run;
}

std::size_t countOf(const std::string &text, const std::string &part)
{
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1))
    ++count;
  return count;
}

TEST(Report, HasAPanelAndAPlaceOnTheMapForEachTrunk)
{
  const std::string page = reportHtml(smallRun());
  EXPECT_EQ(countOf(page, "class=\"panel\""), 2u);
  EXPECT_EQ(countOf(page, "class=\"trunk\""), 2u);
  EXPECT_EQ(countOf(page, "<tr data-id="), 2u);
  EXPECT_EQ(countOf(page, "data:image/jpeg;base64,"), 1u);
  EXPECT_THAT(page, HasSubstr("a &lt;drawn&gt; flight"));
}

TEST(Report, NeedsNothingFromElsewhere)
{
  const std::string page = reportHtml(smallRun());
  EXPECT_THAT(page, AllOf(Not(HasSubstr("src=\"http")), Not(HasSubstr("href=\"http")), Not(HasSubstr("@import")),
                          Not(HasSubstr("<script src"))));
}

TEST(Report, SaysFirstWhatIsDoubtful)
{
  RunRecord run = smallRun();
  EXPECT_THAT(reportHtml(run), HasSubstr("<b>Done</b>"));
  run.doubts = {"The scale is a guess: --camera-height would tell it."};
  EXPECT_THAT(reportHtml(run), AllOf(HasSubstr("<b>Done, with doubts</b>"), HasSubstr("--camera-height")));
  run.is_trusted = false;
  EXPECT_THAT(reportHtml(run), HasSubstr("<b>Not to be trusted</b>"));
}

TEST(Report, OfARunWithoutRangesHasNoMetres)
{
  RunRecord run = smallRun();
  run.has_ranges = false;
  run.map_svg = "<svg id=\"bearings\"></svg>";
  const std::string page = reportHtml(run);
  EXPECT_THAT(page, HasSubstr("<svg id=\"bearings\">"));
  EXPECT_THAT(page, AllOf(Not(HasSubstr("class=\"panel\"")), Not(HasSubstr("[m]")), Not(HasSubstr("[cm]")),
                          Not(HasSubstr("export"))));
}

TEST(Report, DrawsTheTruthWhereThereIsOne)
{
  RunRecord run = smallRun();
  EXPECT_THAT(mapHtml(run), Not(HasSubstr("truth")));
  run.truth = run.smoothed;
  run.truth_trunks = {{9, {4, 0.5}, 0.2, 0}};
  EXPECT_THAT(mapHtml(run), AllOf(HasSubstr("trunks, truth"), HasSubstr("trajectory, truth")));
  EXPECT_THAT(trajectoryCharts(run), HasSubstr("horizontal error"));
}

TEST(Report, TheTimeLineTellsFramesSensorsAndTrunks)
{
  RunRecord run = smallRun();
  run.sensors = {{"gyro", "stuck", 1.0, "gyro: frozen since 1.0 s"}};
  const std::string svg = timeLine(run);
  EXPECT_THAT(svg, AllOf(HasSubstr(">corrupt<"), HasSubstr(">gyro<"), HasSubstr(">trunk 1<"), HasSubstr(">trunk 2<")));
  EXPECT_THAT(svg, Not(HasSubstr(">stale<"))); // no frame was
}

TEST(Report, OfNoTrunksAndNoFramesIsStillAPage)
{
  EXPECT_THAT(reportHtml(RunRecord()), testing::EndsWith("</html>\n"));
}

TEST(Trace, ReadsBackWhatItWrote)
{
  const RunRecord run = smallRun();
  std::string folder = (std::filesystem::temp_directory_path() / "bole-trace-XXXXXX").string();
  folder = mkdtemp(folder.data());
  writeTrace(folder, run.trace);
  const FlightTrace back = readTrace(folder);
  std::filesystem::remove_all(folder);
  ASSERT_EQ(back.frames.size(), run.trace.frames.size());
  EXPECT_EQ(back.frames[7].status, FrameStatus::corrupt);
  EXPECT_EQ(back.frames[29].stamp_ns, run.trace.frames[29].stamp_ns);
  EXPECT_NEAR(back.frames[29].covariance_xy(1, 1), 1e-4, 1e-8);
  ASSERT_EQ(back.views.size(), run.trace.views.size());
  EXPECT_NEAR(back.views[3].range, 3.7, 1e-4);
  EXPECT_NEAR(back.views[3].xy_sigma.y(), 0.02, 1e-4);
  ASSERT_EQ(back.evidence.squares().size(), 1u);
  EXPECT_EQ(back.evidence.squares()[0].second, 5);
}

TEST(BestViews, KeepTheLargestViewOfATrunkThatIsWhole)
{
  const PinholeCamera camera;
  const Eigen::Matrix3d ahead = (Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished();
  Trunk trunk;
  trunk.log_radius = std::log(0.2);
  const vpImage<unsigned char> dark(240, 320, 10), bright(240, 320, 200);
  const auto seenFrom = [&](double x, double y) {
    trunk.xy = {x, y};
    return relativeTrunk(Pose(ahead, {0, 0, 1}), Pose(), trunk);
  };
  BestViews views;
  EXPECT_EQ(views.jpeg(4), "");
  views.add(4, bright, camera, seenFrom(2, 0), -0.3, 0.3);
  views.add(4, dark, camera, seenFrom(5, 0), -0.3, 0.3);     // smaller
  views.add(4, dark, camera, seenFrom(1.5, 1.2), -0.3, 0.3); // only one border in the image
  const std::string jpeg = views.jpeg(4);
  const cv::Mat picture = cv::imdecode(std::vector<unsigned char>(jpeg.begin(), jpeg.end()), cv::IMREAD_GRAYSCALE);
  ASSERT_FALSE(picture.empty());
  EXPECT_NEAR(picture.at<unsigned char>(picture.rows / 2, picture.cols / 2), 200, 12);
  EXPECT_GT(picture.rows, 100);
}
} // namespace
