// SPDX-License-Identifier: GPL-2.0-or-later
// What people look at: the overlay, the videos, the map.
#include "support/test.h"

#include "input/recorded_source.h"
#include "output/map_svg.h"
#include "output/video_writer.h"
#include <bole/open_source.h>
#include <bole/overlay.h>
#include <regex>

namespace
{
using namespace bole;
using testing::HasSubstr;
namespace fs = std::filesystem;

const PinholeCamera kCamera;

TrunkInView trunkAhead(TrunkStatus status = TrunkStatus::confirmed)
{
  const Trunk trunk{{3, 0}, std::log(0.3)};
  TrunkInView ahead;
  ahead.id = 4;
  ahead.status = status;
  ahead.is_tracked = true;
  ahead.tan_low = -0.3;
  ahead.tan_high = 0.6;
  ahead.relative = relativeTrunk(Pose(forwardCamera().R, {0, 0, 1.2}), Pose(), trunk);
  return ahead;
}

double distanceOf(const vpRGBa &a, const vpRGBa &b)
{
  return std::hypot(std::hypot(double(a.R) - b.R, double(a.G) - b.G), double(a.B) - b.B);
}

/// Pixels that are near the colour of the trunk's id, over the image without the bar of text.
int coloured(const vpImage<vpRGBa> &picture, int id, double within = 60)
{
  int count = 0;
  for (unsigned v = 0; v < 480; ++v)
    for (unsigned u = 0; u < picture.getWidth(); ++u)
      count += distanceOf(picture[v][u], colourOf(id)) < within;
  return count;
}

vpImage<vpRGBa> drawnWith(const Overlay &overlay)
{
  return drawOverlay(vpImage<unsigned char>(240, 320, 20), kCamera, overlay);
}

TEST(Overlay, DrawsTheBordersWhereTheCameraSeesThem)
{
  Overlay overlay;
  overlay.trunks = {trunkAhead()};
  const vpImage<vpRGBa> picture = drawnWith(overlay);
  ASSERT_EQ(picture.getWidth(), 640u); // twice as large, and the bar below
  ASSERT_GT(picture.getHeight(), 480u);
  for (const Border border : {Border::left, Border::right}) {
    const Eigen::Vector2d u = kCamera.project(overlay.trunks[0].relative.borderDirection(border, 0.1));
    const auto column = static_cast<unsigned>(std::lround(2 * u.x() + 0.5)),
               row = static_cast<unsigned>(std::lround(2 * u.y() + 0.5));
    EXPECT_LT(distanceOf(picture[row][column], colourOf(4)), 60);
    const unsigned outside = border == Border::left ? column - 20 : column + 20;
    EXPECT_LT(distanceOf(picture[row][outside], vpRGBa(20, 20, 20, 255)), 10);
  }
}

TEST(Overlay, TellsCandidatesFromConfirmedAndPredictedFromObserved)
{
  const auto count = [](TrunkStatus status, bool is_tracked) {
    Overlay overlay;
    overlay.trunks = {trunkAhead(status)};
    overlay.trunks[0].is_tracked = is_tracked;
    return coloured(drawnWith(overlay), 4);
  };
  const int confirmed = count(TrunkStatus::confirmed, true), candidate = count(TrunkStatus::candidate, true);
  EXPECT_LT(candidate, 0.8 * confirmed);                            // thin
  EXPECT_LT(count(TrunkStatus::candidate, false), 0.8 * candidate); // dashed
  EXPECT_GT(count(TrunkStatus::candidate, false), 0);
}

TEST(Overlay, ShowsTheForegroundAsAnInsetOnlyWhenThereIsOne)
{
  Overlay overlay;
  const vpImage<vpRGBa> without = drawnWith(overlay);
  overlay.foreground.resize(24, 32);
  for (unsigned i = 0; i < overlay.foreground.getSize(); ++i)
    overlay.foreground.bitmap[i] = i % 32 < 16 ? 0.f : 1.f;
  const vpImage<vpRGBa> with = drawnWith(overlay);
  EXPECT_LT(distanceOf(without[60][600], vpRGBa(20, 20, 20, 255)), 5);
  EXPECT_GT(with[60][610].R, with[60][610].B); // near on the right: orange
  EXPECT_LT(with[60][490].R, with[60][490].B); // far on the left: blue
  EXPECT_LT(distanceOf(with[300][600], vpRGBa(20, 20, 20, 255)), 5);
}

TEST(Overlay, DrawsAFrameWithoutImageGreyAndOfTheSameSize)
{
  Overlay overlay;
  overlay.text = "missing";
  const vpImage<vpRGBa> picture = drawOverlay(vpImage<unsigned char>(), kCamera, overlay);
  EXPECT_EQ(picture.getWidth(), 640u);
  EXPECT_EQ(picture.getHeight(), drawnWith(overlay).getHeight());
  EXPECT_LT(distanceOf(picture[100][100], vpRGBa(96, 96, 96, 255)), 5);
}

TEST(Overlay, SurvivesATrunkThatIsNoNumberOrBehindTheCamera)
{
  Overlay overlay;
  overlay.trunks = {trunkAhead(), trunkAhead()};
  overlay.trunks[0].relative.log_ratio = std::nan("");
  overlay.trunks[1].relative.cRt.col(0) *= -1;
  overlay.trunks[1].relative.cRt.col(1) *= -1;
  EXPECT_EQ(coloured(drawnWith(overlay), 4), 0);
}

TEST(Overlay, NeighbouringIdsHaveColoursThatDiffer)
{
  for (int id = 0; id < 30; ++id)
    EXPECT_GT(distanceOf(colourOf(id), colourOf(id + 1)), 80) << id;
}

TEST(Overlay, PutsTheSaliencyBesideTheImage)
{
  const vpImage<float> foreground(24, 32, 1.f);
  const vpImage<vpRGBa> both = drawSaliency(vpImage<unsigned char>(240, 320, 20), kCamera, foreground, "text");
  ASSERT_EQ(both.getWidth(), 1280u);
  EXPECT_LT(distanceOf(both[100][100], vpRGBa(20, 20, 20, 255)), 5);
  EXPECT_GT(both[100][1000].R, 200);
}

vpImage<vpRGBa> card(int i)
{
  vpImage<vpRGBa> picture(65, 97); // odd: the last row and column are lost
  for (unsigned v = 0; v < 65; ++v)
    for (unsigned u = 0; u < 97; ++u) {
      const auto grey = static_cast<unsigned char>(40 + 12 * i + (u > 48 ? 60 : 0));
      picture[v][u] = vpRGBa(grey, grey, grey, 255);
    }
  return picture;
}

TEST(VideoWriter, GivesBackEveryPictureWithItsTime)
{
  const test::TemporaryFolder folder;
  const std::string path = folder / "round_trip.mp4";
  const std::vector<std::int64_t> stamps_ms = {5000, 5100, 5200, 5350, 5400, 6400, 6500, 6533};
  {
    VideoWriter video(path);
    for (std::size_t i = 0; i < stamps_ms.size(); ++i)
      video.write(card(static_cast<int>(i)), stamps_ms[i] * 1000000);
    EXPECT_EQ(video.pictures(), stamps_ms.size());
    EXPECT_FALSE(fs::exists(path)); // not before it is whole
    video.finish();
  }
  VideoSource read(path);
  EXPECT_EQ(read.size(), stamps_ms.size());
  for (std::size_t i = 0; i < stamps_ms.size(); ++i) {
    Frame frame;
    ASSERT_TRUE(read.next(frame)) << i;
    EXPECT_EQ(frame.status, FrameStatus::ok) << i;
    EXPECT_EQ(frame.image.getWidth(), 96u);
    EXPECT_EQ(frame.image.getHeight(), 64u);
    EXPECT_NEAR(static_cast<double>(frame.stamp_ns) * 1e-6, static_cast<double>(stamps_ms[i] - 5000), 0.1);
    EXPECT_NEAR(frame.image[32][20], 40 + 12 * static_cast<int>(i), 4);
    EXPECT_NEAR(frame.image[32][80], 100 + 12 * static_cast<int>(i), 4);
  }
  Frame end;
  EXPECT_FALSE(read.next(end));
}

TEST(VideoWriter, DropsAPictureWhoseTimeDoesNotRiseRefusesAnotherSizeAndLeavesNothingWithoutFinish)
{
  const test::TemporaryFolder folder;
  {
    VideoWriter video(folder / "unfinished.mp4");
    video.write(card(0), 1000000000);
    video.write(card(1), 1000000000);
    EXPECT_EQ(video.pictures(), 1u);
    video.write(card(1), 1040000000);
    EXPECT_THROW(video.write(vpImage<vpRGBa>(64, 64), 2000000000), vpException);
  }
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

MapPicture smallMap()
{
  MapPicture picture;
  picture.title = "a walk";
  for (int i = 0; i < 5; ++i)
    picture.smoothed.push_back({i, Pose(Eigen::Matrix3d::Identity(), {1.0 * i, 0, 1})});
  TrunkRecord trunk;
  trunk.xy = {2, 1};
  trunk.radius = 0.2;
  trunk.covariance.topLeftCorner<2, 2>() = Eigen::Vector2d(0.04, 0.01).asDiagonal();
  trunk.status = TrunkStatus::confirmed;
  picture.trunks.push_back(trunk);
  return picture;
}

/// The number that follows \p name in the first tag that matches.
double numberIn(const std::string &svg, const std::string &tag, const std::string &name)
{
  std::smatch match;
  const std::regex pattern("<" + tag + "[^>]*\\b" + name + "=\"([-0-9.]+)\"");
  return std::regex_search(svg, match, pattern) ? std::stod(match[1]) : NAN;
}

int circlesIn(const std::string &svg)
{
  const std::regex circle("<circle");
  return static_cast<int>(std::distance(std::sregex_iterator(svg.begin(), svg.end(), circle), std::sregex_iterator()));
}

TEST(MapSvg, DrawsTrunksToScaleWithTheirTwoSigmaEllipse)
{
  const std::string svg = toSvg(smallMap());
  EXPECT_NEAR(numberIn(svg, "circle", "r"), 40 * 0.2, 0.06);
  EXPECT_NEAR(numberIn(svg, "ellipse", "rx"), 40 * 2 * 0.2, 0.06);
  EXPECT_NEAR(numberIn(svg, "ellipse", "ry"), 40 * 2 * 0.1, 0.06);
  // the path begins 2 m left of the trunk and 1 m below it
  std::smatch begin;
  ASSERT_TRUE(std::regex_search(svg, begin, std::regex("<polyline points=\"([-0-9.]+),([-0-9.]+) ")));
  EXPECT_NEAR(numberIn(svg, "circle", "cx") - std::stod(begin[1]), 40 * 2, 0.11);
  EXPECT_NEAR(numberIn(svg, "circle", "cy") - std::stod(begin[2]), -40 * 1, 0.11);
}

double yOfText(const std::string &svg, const std::string &text)
{
  std::smatch match;
  const bool is_there = std::regex_search(svg, match, std::regex("y=\"([-0-9.]+)\"[^>]*>" + text + "</text>"));
  return is_there ? std::stod(match[1]) : NAN;
}

TEST(MapSvg, LabelsNeitherCollideNorLieUnderTheLegendOrBeyondTheSheet)
{
  MapPicture picture = smallMap();
  picture.trunks[0].id = 101;
  for (int i = 1; i < 6; ++i) {
    picture.trunks.push_back(picture.trunks[0]);
    picture.trunks.back().id = 101 + i;
    picture.trunks.back().xy += Eigen::Vector2d(0.05 * i, 0.02 * i);
  }
  const std::string svg = toSvg(picture);
  const double legend_ends = yOfText(svg, "trajectory, smoothed"), height = numberIn(svg, "svg", "height");
  std::vector<std::pair<double, double>> places;
  const std::regex label("<text x=\"([-0-9.]+)\" y=\"([-0-9.]+)\"[^>]*>10[0-9]</text>");
  for (std::sregex_iterator at(svg.begin(), svg.end(), label); at != std::sregex_iterator(); ++at)
    places.emplace_back(std::stod((*at)[1]), std::stod((*at)[2]));
  EXPECT_GE(places.size(), 4u); // one that finds no room is left out
  for (std::size_t i = 0; i < places.size(); ++i) {
    EXPECT_GT(places[i].second - 10, legend_ends);
    EXPECT_LT(places[i].second, height);
    for (std::size_t k = 0; k < i; ++k)
      EXPECT_TRUE(std::abs(places[i].first - places[k].first) >= 19 ||
                  std::abs(places[i].second - places[k].second) >= 10);
  }
}

TEST(MapSvg, LeavesOutWhatIsLostOrMergedAndOutlinesCandidates)
{
  MapPicture picture = smallMap();
  const auto circles = [&](TrunkStatus status) {
    picture.trunks[0].status = status;
    return circlesIn(toSvg(picture));
  };
  EXPECT_EQ(circles(TrunkStatus::confirmed), 1);
  EXPECT_EQ(circles(TrunkStatus::candidate), 1);
  EXPECT_THAT(toSvg(smallMap()), HasSubstr("<ellipse"));
  EXPECT_THAT(toSvg(smallMap()), testing::Not(HasSubstr("candidates")));
  MapPicture doubtful = smallMap();
  doubtful.trunks[0].status = TrunkStatus::candidate;
  EXPECT_THAT(toSvg(doubtful), HasSubstr("candidates"));
  EXPECT_EQ(circles(TrunkStatus::lost), 0);
  EXPECT_EQ(circles(TrunkStatus::merged), 0);
}

TEST(MapSvg, DrawsBearingsAndNoLengthsWhereTheCameraOnlyRotated)
{
  MapPicture picture = smallMap();
  picture.has_ranges = false;
  const std::string svg = toSvg(picture);
  EXPECT_EQ(circlesIn(svg), 1); // the horizon
  EXPECT_THAT(svg, testing::AllOf(HasSubstr("<polygon"), testing::Not(HasSubstr(" m</text>"))));
  EXPECT_THAT(svg, HasSubstr("at no known distance"));
}

TEST(MapSvg, DrawsTheTruthOnlyWhereItIsKnown)
{
  MapPicture picture = smallMap();
  EXPECT_THAT(toSvg(picture), testing::Not(HasSubstr("truth")));
  picture.truth = picture.smoothed;
  picture.truth_trunks = {{7, {2.1, 1.1}, 0.2, 0}, {8, {50, 50}, 0.2, 0}}; // the second is outside the sheet
  const std::string svg = toSvg(picture);
  EXPECT_THAT(svg, HasSubstr("trajectory, truth"));
  EXPECT_EQ(circlesIn(svg), 2);
}

TEST(MapSvg, IsXmlWhateverTheTitleHoweverFarATrajectoryWentAstrayAndAlsoOfNothing)
{
  MapPicture picture = smallMap();
  picture.title = "frames <1> & \"2\"";
  EXPECT_THAT(toSvg(picture), HasSubstr("frames &lt;1&gt; &amp; &quot;2&quot;"));
  for (const double far : {1e4, 1e9, 1e33, 1e90}) {
    picture.smoothed = {{0, Pose()}, {1, Pose(Eigen::Matrix3d::Identity(), {far, -far, far})}};
    picture.trunks.clear();
    EXPECT_LT(toSvg(picture).size(), 100'000u) << far;
  }
  EXPECT_THAT(toSvg(MapPicture()), testing::AllOf(testing::StartsWith("<svg"), testing::EndsWith("</svg>\n")));
}
} // namespace
