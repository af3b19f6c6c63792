// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/shell.h"
#include "support/test.h"

#include "output/best_view.h"
#include "report/report_page.h"
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

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

class ReportInABrowser : public testing::Test
{
protected:
  void SetUp() override
  {
    if (test::runShell("command -v chromium").status != 0)
      GTEST_SKIP() << "needs chromium";
  }

  /// The page as a browser has it once its script has run.
  static std::string rendered(const RunRecord &run)
  {
    const test::TemporaryFolder folder;
    const std::string dom = domOf(folder, folder.write("report.html", reportHtml(run)));
    return dom.substr(0, dom.find("<script type"));
  }

  /// What \p expression of JavaScript is in the page of \p run, in a frame that is 400 px wide.
  static std::string narrow(const RunRecord &run, const std::string &expression)
  {
    const test::TemporaryFolder folder;
    folder.write("report.html", reportHtml(run) + "<script>parent.postMessage(" + expression + ", '*')</script>");
    const std::string outer = "<title></title><script>onmessage = e => document.title = e.data</script>"
                              "<iframe src=\"report.html\" style=\"width:400px;height:800px;border:0\"></iframe>";
    const std::string dom = domOf(folder, folder.write("outer.html", outer));
    const std::size_t from = dom.find("<title>") + 7;
    return dom.substr(from, dom.find("</title>") - from);
  }

private:
  static std::string domOf(const test::TemporaryFolder &folder, const std::string &page)
  {
    return test::runShell("chromium --headless --no-sandbox --disable-gpu --user-data-dir=" + folder / "profile" +
                          " --virtual-time-budget=3000 --dump-dom file://" + page + " 2>/dev/null")
        .text;
  }
};

TEST_F(ReportInABrowser, ShowsTrunksTimeLineAndDoubts)
{
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

TEST_F(ReportInABrowser, OpensWithTheLikeliestTrunkAndOfEqualOnesWithTheNearest)
{
  RunRecord run = smallRun();
  run.trunks = {trunkOf(1), trunkOf(2), trunkOf(3), trunkOf(4)};
  run.trunks[0].probability = 0.7; // the nearest
  run.trunks[1].probability = 0.954;
  run.trunks[2].probability = 0.951;
  run.trunks[2].xy.y() = 0.6; // nearer than the second, and as likely in whole per cent
  run.trunks[3].probability = 0.94;
  const std::string dom = rendered(run);
  EXPECT_THAT(dom, HasSubstr("<h3>Trunk 3</h3>"));
  EXPECT_EQ(countOf(dom, "class=\"chosen\""), 1u);
}

TEST_F(ReportInABrowser, TellsTheTwoKindsOfSigmaApart)
{
  RunRecord run = smallRun();
  EXPECT_THAT(rendered(run), AllOf(HasSubstr("<dt>σ in the world</dt>"), HasSubstr("<dt>σ to the camera</dt>"),
                                   Not(HasSubstr("and the scale"))));
  run.scale_sigma = 0.14;
  EXPECT_THAT(rendered(run), HasSubstr("the scale, which is known to ± 14 %"));
}

TEST_F(ReportInABrowser, KeepsATableInItsBoxWithTheFirstColumnInANarrowWindow)
{
  const std::string text = narrow(smallRun(), R"((() => {
    const box = [...document.querySelectorAll('.wide')].find(e => e.querySelector('tr[data-id]'));
    box.scrollLeft = 60;
    const left = e => Math.round(e.getBoundingClientRect().left);
    return ['width', innerWidth, 'fits', document.documentElement.scrollWidth <= innerWidth, 'scrolled', box.scrollLeft > 20, 'kept',
            left(box.querySelector('td')) - left(box)].join(' ');
  })())");
  EXPECT_EQ(text, "width 400 fits true scrolled true kept 0");
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

/// A trunk of 0.2 m at places ahead of a camera that stands 1 m over the ground, and pictures of it.
class BestViewsOfATrunk : public testing::Test
{
protected:
  RelativeTrunk seenFrom(double x, double y)
  {
    Trunk trunk;
    trunk.log_radius = std::log(0.2);
    trunk.xy = {x, y};
    const Eigen::Matrix3d ahead = (Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished();
    return relativeTrunk(Pose(ahead, {0, 0, 1}), Pose(), trunk);
  }

  /// A picture of grey 100 in which \p trunk has the grey level \p bark, blurred by \p sigma_px.
  vpImage<unsigned char> pictureOf(const RelativeTrunk &trunk, unsigned char bark, double sigma_px = 0)
  {
    vpImage<unsigned char> image(240, 320, 100);
    const double left = camera.project(trunk.borderDirection(Border::left, 0)).x();
    const double right = camera.project(trunk.borderDirection(Border::right, 0)).x();
    cv::Mat pixels(240, 320, CV_8UC1, image.bitmap);
    pixels.colRange(std::max(0, static_cast<int>(left)), std::min(320, static_cast<int>(right))) = bark;
    if (sigma_px > 0)
      cv::GaussianBlur(pixels, pixels, {}, sigma_px);
    return image;
  }

  void add(const RelativeTrunk &trunk, unsigned char bark, double tan_high = 0.3, double sigma_px = 0)
  {
    views.add(4, pictureOf(trunk, bark, sigma_px), camera, trunk, -0.3, tan_high);
  }

  /// Grey level of the bark in the view that was kept.
  int kept()
  {
    const std::string jpeg = views.jpeg(4);
    const cv::Mat picture = cv::imdecode(std::vector<unsigned char>(jpeg.begin(), jpeg.end()), cv::IMREAD_GRAYSCALE);
    return picture.empty() ? -1 : picture.at<unsigned char>(picture.rows / 2, picture.cols / 2);
  }

  const PinholeCamera camera;
  BestViews views;
};

TEST_F(BestViewsOfATrunk, AreTheLargestWithBothBordersInThePicture)
{
  EXPECT_EQ(views.jpeg(4), "");
  add(seenFrom(2, 0), 200);
  add(seenFrom(5, 0), 20);     // smaller
  add(seenFrom(1.5, 1.2), 20); // only one border in the picture
  EXPECT_NEAR(kept(), 200, 12);
}

TEST_F(BestViewsOfATrunk, HoldTheTrackedPartRatherThanALargerOneThatLeavesThePicture)
{
  add(seenFrom(2, 0), 200);
  add(seenFrom(1.5, 0), 20, 2.5); // larger, but two thirds are above the picture
  EXPECT_NEAR(kept(), 200, 12);
  views.forget(4);
  add(seenFrom(1.5, 0), 20, 2.5); // better than nothing
  EXPECT_NEAR(kept(), 20, 12);
}

TEST_F(BestViewsOfATrunk, AreSharpRatherThanALittleLarger)
{
  add(seenFrom(2, 0), 20, 0.3, 4);
  add(seenFrom(2.2, 0), 200); // smaller and sharp
  EXPECT_NEAR(kept(), 200, 12);
  add(seenFrom(1.8, 0), 20, 0.3, 4);
  EXPECT_NEAR(kept(), 200, 12);
}
} // namespace
