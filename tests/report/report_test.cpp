// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/shell.h"
#include "support/test.h"

#include "output/best_view.h"
#include "report/report_page.h"
#include <nlohmann/json.hpp>
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

nlohmann::json jsonOf(const RunRecord &run) { return nlohmann::json::parse(reportJson(run)); }

TEST(Report, TellsOfEachConfirmedTrunkWhatWasKnownAndOfOthersWhereTheyStand)
{
  const nlohmann::json trunks = jsonOf(smallRun())["trunks"];
  ASSERT_EQ(trunks.size(), 4u);
  EXPECT_EQ(trunks[0]["picture"], "data:image/jpeg;base64,cGljdHVyZQ==");
  EXPECT_EQ(trunks[0]["curve"].size(), 30u);
  EXPECT_NEAR(trunks[0]["curve"][3][1], 3.7, 1e-9);
  EXPECT_FALSE(trunks[1].contains("picture"));
  EXPECT_TRUE(trunks[1]["curve"].empty());
  EXPECT_EQ(trunks[2]["status"], "candidate");
  EXPECT_FALSE(trunks[2].contains("curve"));
}

TEST(Report, NeedsNothingFromElsewhere)
{
  std::string page = reportHtml(smallRun());
  const std::string name_of_svg = "http://www.w3.org/2000/svg";
  page.replace(page.find(name_of_svg), name_of_svg.size(), "");
  EXPECT_THAT(page, AllOf(Not(HasSubstr("http")), Not(HasSubstr("@import")), Not(HasSubstr("<script src"))));
}

TEST(Report, NoWordOfARunBecomesMarkup)
{
  RunRecord run = smallRun();
  const std::size_t scripts = countOf(reportHtml(run), "<");
  const std::string attack = "</script><script>alert(1)</script><!--";
  run.input = run.note = run.sha256 = run.folder = run.working_folder = attack;
  run.facts = run.doubts = run.command = {attack};
  run.versions[attack] = attack;
  run.sensors = {{attack, attack, 1.0, attack}};
  EXPECT_EQ(countOf(reportHtml(run), "<"), scripts);
  EXPECT_EQ(jsonOf(run)["note"], attack);
}

TEST(Report, RunsOfFramesThatAreAlikeBecomeOneBox)
{
  RunRecord run = smallRun();
  run.sensors = {{"gyro", "stuck", 1.0, "gyro: frozen since 1.0 s"}};
  const nlohmann::json json = jsonOf(run);
  ASSERT_EQ(json["statuses"].size(), 3u);
  EXPECT_EQ(json["statuses"][1][2], "corrupt");
  EXPECT_NEAR(json["statuses"][1][0], 0.7, 1e-9);
  EXPECT_NEAR(json["statuses"][1][1], 0.8, 1e-9);
  EXPECT_EQ(json["sensors"][0]["sensor"], "gyro");
  EXPECT_EQ(json["trunks"][0]["seen"].size(), 1u); // all the time
  EXPECT_EQ(json["trunks"][1]["seen"][0][2], false);
}

TEST(Report, MeasuresTheErrorOfThePathWhereThereIsATruth)
{
  RunRecord run = smallRun();
  EXPECT_TRUE(jsonOf(run)["errors"].empty());
  run.truth = run.smoothed;
  for (StampedPose &pose : run.truth)
    pose.wMb.t.y() += 0.25;
  EXPECT_NEAR(jsonOf(run)["errors"][7][1], 0.25, 1e-9);
}

TEST(Report, OfLongFlightsDrawsWhatIsSeen)
{
  RunRecord run = smallRun();
  const StampedPose pose = run.smoothed.back();
  run.smoothed.resize(100000, pose);
  run.trace.frames.resize(100000, run.trace.frames.back());
  const nlohmann::json json = jsonOf(run);
  EXPECT_LE(json["smoothed"].size(), 4000u);
  EXPECT_LE(json["places"].size(), 400u);
}

/// The page as a browser has it once its script has run.
std::string rendered(const RunRecord &run)
{
  const test::TemporaryFolder folder;
  const std::string page = folder.write("report.html", reportHtml(run));
  const std::string dom =
      test::runShell("chromium --headless --no-sandbox --disable-gpu --user-data-dir=" + folder / "profile" +
                     " --virtual-time-budget=3000 --dump-dom file://" + page + " 2>/dev/null")
          .text;
  return dom.substr(0, dom.find("<script type"));
}

TEST(ReportInABrowser, ShowsTrunksTimeLineAndDoubts)
{
  if (test::runShell("command -v chromium").status != 0)
    GTEST_SKIP() << "needs chromium";
  RunRecord run = smallRun();
  std::string dom = rendered(run);
  EXPECT_EQ(countOf(dom, "class=\"trunk"), 2u);
  EXPECT_EQ(countOf(dom, "<tr data-id="), 2u);
  EXPECT_THAT(dom, AllOf(HasSubstr(">Done<"), HasSubstr("a &lt;drawn&gt; flight"), HasSubstr("Trunk 1"),
                         HasSubstr("How it was made")));
  run.doubts = {"The scale is a guess: --camera-height would tell it."};
  run.is_trusted = false;
  run.has_ranges = false;
  dom = rendered(run);
  EXPECT_THAT(dom, AllOf(HasSubstr("Not to be trusted"), HasSubstr("Bearings"), HasSubstr("How it was made")));
  EXPECT_THAT(dom, AllOf(Not(HasSubstr("[m]")), Not(HasSubstr("bole export"))));
  EXPECT_THAT(rendered(RunRecord()), HasSubstr("How it was made"));
}

TEST(Trace, ReadsBackWhatItWrote)
{
  const RunRecord run = smallRun();
  const test::TemporaryFolder folder;
  writeTrace(folder.path(), run.trace);
  const FlightTrace back = readTrace(folder.path());
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
