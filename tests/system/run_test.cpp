// SPDX-License-Identifier: GPL-2.0-or-later
// What is left of a run that does not go to its end, or is not worth much.
#include "run_bole.h"
#include "support/test.h"

#include "output/flight_trace.h"
#include "output/trunks_csv.h"
#include <bole/open_source.h>
#include <visp3/io/vpImageIo.h>

namespace
{
namespace fs = std::filesystem;
using namespace bole::test;
using testing::HasSubstr;

/// Pixels of the first picture of a video that are far from those of the flight's, without the bar of text.
std::size_t drawnOnTheFirstPicture(const std::string &video)
{
  vpImage<unsigned char> picture;
  vpImageIo::read(picture, kFlight + "/mav0/cam0/data/0000000000000.png");
  bole::Frame frame;
  EXPECT_TRUE(bole::openSource(video)->next(frame));
  std::size_t drawn = 0;
  const unsigned factor = frame.image.getWidth() / picture.getWidth();
  for (unsigned v = 0; v < picture.getHeight(); ++v)
    for (unsigned u = 0; u < picture.getWidth(); ++u)
      drawn += std::abs(int(picture[v][u]) - frame.image[factor * v + factor / 2][factor * u + factor / 2]) > 80;
  return drawn;
}

TEST(Run, TheOverlayOfAFileShowsTheFinalMapAndWithOnlineTheMapInFlight)
{
  const std::string final_map = freshFolder("overlay_final"), in_flight = freshFolder("overlay_online");
  const std::string flight = "track " + kFlight + " --frames 30 -q --set stages.saliency=false -o ";
  ASSERT_EQ(run(flight + final_map).status, 0);
  ASSERT_EQ(run(flight + in_flight + " --online").status, 0);
  const std::size_t coding = drawnOnTheFirstPicture(in_flight + "/overlay.mp4"); // nothing is known of it then
  EXPECT_LT(coding, 200u);
  EXPECT_GT(drawnOnTheFirstPicture(final_map + "/overlay.mp4"), 3 * coding);
}

TEST(Run, HasAPictureAndViewsOfEachTrunk)
{
  const std::string folder = freshFolder("pictures");
  ASSERT_EQ(run("track " + kFlight + " -o " + folder + " -q --no-video").status, 0);
  const std::vector<bole::TrunkRecord> trunks = bole::readTrunks(folder + "/trunks.csv");
  const bole::FlightTrace trace = bole::readTrace(folder);
  EXPECT_GE(trunks.size(), 6u);
  for (const bole::TrunkRecord &trunk : trunks) {
    EXPECT_TRUE(fs::exists(fmt::format("{}/views/{}.jpg", folder, trunk.id))) << trunk.id;
    const auto views = std::count_if(trace.views.begin(), trace.views.end(),
                                     [&](const bole::TrunkTrace &view) { return view.id == trunk.id; });
    EXPECT_GE(views, trunk.observations) << trunk.id; // a frame from where another was taken is a view, but no factor
  }
}

TEST(Run, HoldsItsCommandItsOptionsAndItsInput)
{
  const std::string folder = freshFolder("redo");
  ASSERT_EQ(run("track " + kFlight + " -o " + folder + " --frames 15 --no-video --quiet").text, "");
  const auto summary = jsonOf(folder + "/summary.json");
  EXPECT_EQ(summary.at("command").at(1), "track");
  EXPECT_EQ(summary.at("input").at("sha256").get<std::string>().size(), 64u);
  EXPECT_GT(summary.at("input").at("bytes"), 100000);
  EXPECT_EQ(summary.at("options"), textOf(folder + "/options.yaml"));
  EXPECT_THAT(textOf(folder + "/options.yaml"), HasSubstr("map:"));
}

TEST(Run, IsRepeatedFromItsFolderToTheSameBytes)
{
  const std::string folder = freshFolder("repeated");
  ASSERT_EQ(run("track park-forward -o " + folder + " --frames 15 -q --set map.lag=4 --without gyro").status, 0);
  const Outcome same = run("track --again " + folder, "cd / && ");
  EXPECT_EQ(same.status, 0) << same.text;
  EXPECT_THAT(same.text, HasSubstr("trunks.csv: the same bytes\ntrajectory.tum: the same bytes"));
  EXPECT_FALSE(fs::exists(folder + "/again"));

  std::ofstream(folder + "/trajectory.tum", std::ios::app) << "# changed\n";
  const Outcome changed = run("track --again " + folder);
  EXPECT_EQ(changed.status, 3);
  EXPECT_THAT(changed.text, HasSubstr("trajectory.tum: DIFFERS"));
  EXPECT_TRUE(fs::exists(folder + "/again/trajectory.tum"));
  EXPECT_EQ(run("track --again " + folder + " --frames 3").status, 1);
  EXPECT_THAT(run("track --again " + testing::TempDir()).text, HasSubstr("summary.json: no such file"));
}

TEST(Run, TellsOnAPageWhatItIsWorth)
{
  const std::string folder = freshFolder("page");
  ASSERT_EQ(run("track " + kFlight + " -o " + folder + " --frames 60 -q --no-video").status, 0);
  const std::string page = textOf(folder + "/report.html");
  EXPECT_THAT(page, HasSubstr("data:image/jpeg;base64,"));
  EXPECT_THAT(page, HasSubstr("\"evaluation\":{"));
  EXPECT_THAT(page, testing::Not(testing::ContainsRegex("src=\"[^d]"))); // nothing but data
  EXPECT_EQ(run("report " + folder).status, 0);
  EXPECT_THAT(textOf(folder + "/report.html"), HasSubstr("\"evaluation\":null"));
}

TEST(Run, PutsNoProgressIntoALog)
{
  const std::string folder = freshFolder("log");
  const Outcome outcome = run("simulate --frames 12 --samples 1 --seed 3 -o " + folder);
  EXPECT_EQ(outcome.status, 0);
  EXPECT_EQ(outcome.text, folder + "\n");
}

TEST(Run, OfACameraThatNeverMovedSaysSoAndHasNoLengths)
{
  const std::string frames = freshFolder("still_frames"), folder = freshFolder("still");
  fs::create_directories(frames);
  vpImage<unsigned char> picture;
  vpImageIo::read(picture, kFlight + "/mav0/cam0/data/0000000000000.png");
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 2);
  for (int k = 0; k < 25; ++k) {
    vpImage<unsigned char> noisy = picture;
    for (unsigned int i = 0; i < noisy.getSize(); ++i)
      noisy.bitmap[i] = static_cast<unsigned char>(std::clamp(noisy.bitmap[i] + noise(random), 0.0, 255.0));
    vpImageIo::write(noisy, frames + "/" + std::to_string(1000 + k) + ".png");
  }
  const Outcome outcome = run("track " + frames + " -o " + folder + " --no-video");
  EXPECT_EQ(outcome.status, 3) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("THE CAMERA NEVER MOVED"));
  EXPECT_EQ(jsonOf(folder + "/summary.json").at("trusted"), false);
  EXPECT_EQ(linesIn(folder + "/trunks.csv"), 2u); // names and units
  EXPECT_TRUE(fs::exists(folder + "/bearings.csv"));
}

TEST(Command, AloneListsTheCommands)
{
  const Outcome outcome = run("");
  EXPECT_EQ(outcome.status, 0);
  EXPECT_THAT(outcome.text, testing::AllOf(HasSubstr("track"), HasSubstr("evaluate"), HasSubstr("Exit status")));
}

TEST(Command, SuggestsTheNearestOfWhatItDoesNotKnow)
{
  const Outcome command = run("trakc x -o y"), option = run("track x -o y --no-vidoe"),
                preset = run("track x -o y --config tabeltop");
  EXPECT_EQ(command.status, 2);
  EXPECT_THAT(command.text, HasSubstr("trakc: no such command, did you mean track?"));
  EXPECT_EQ(option.status, 2);
  EXPECT_THAT(option.text, HasSubstr("--no-vidoe: no such option, did you mean --no-video?"));
  EXPECT_EQ(preset.status, 1);
  EXPECT_THAT(preset.text, HasSubstr("did you mean tabletop?"));
}

/// What ViSP's trackers and robots and the decoders of other programs bring takes longer to load than a frame to map.
TEST(Command, LoadsWhatItNeeds)
{
  const Outcome outcome = run("", "LD_TRACE_LOADED_OBJECTS=1 ");
  EXPECT_THAT(outcome.text, HasSubstr("libbole_core.so"));
  for (const char *heavy : {"libbole.so", "libvisp_mbt", "libvisp_robot", "libvisp_io", "libvisp_gui", "imgcodecs",
                            "opencv_video", "libgdal", "libCoin"})
    EXPECT_THAT(outcome.text, testing::Not(HasSubstr(heavy)));
  EXPECT_THAT(run("follow --help").text, HasSubstr("--model"));
}

TEST(Command, FindsItsPresetsFromAnyFolder)
{
  const std::string folder = freshFolder("preset");
  const Outcome outcome =
      run("track " + kFlight + " -o " + folder + " --frames 3 --no-video --config tabletop", "cd / && ");
  EXPECT_EQ(outcome.status, 3) << outcome.text; // three frames give no trunk
  EXPECT_EQ(jsonOf(folder + "/summary.json").at("preset"), "tabletop");
}
} // namespace
