// SPDX-License-Identifier: GPL-2.0-or-later
// What a run says of itself.
#include "support/test.h"

#include "output/summary_json.h"
#include <atomic>
#include <nlohmann/json.hpp>

using namespace bole;
using testing::HasSubstr;

namespace
{
RunSummary goodRun()
{
  RunSummary summary;
  summary.input = "flight";
  summary.frames[FrameStatus::ok] = 100;
  summary.duration_s = 10;
  summary.path_m = 8;
  summary.extent_m = 7;
  TrunkRecord trunk;
  trunk.status = TrunkStatus::confirmed;
  trunk.covariance.diagonal() << 0.0009, 0.0016, 0.0001, 1, 1;
  summary.trunks = {trunk, TrunkRecord()};
  return summary;
}

std::string textOf(const RunSummary &summary) { return toText(judge(summary)); }
} // namespace

TEST(Verdict, AGoodRunTellsItsFiguresAndDoubtsNothing)
{
  const Verdict verdict = judge(goodRun());
  EXPECT_TRUE(verdict.is_trusted);
  EXPECT_TRUE(verdict.doubts.empty());
  EXPECT_THAT(toText(verdict), HasSubstr("path 8.00 m in 10.0 s; 100 frames, all ok"));
  EXPECT_THAT(toText(verdict), HasSubstr("1 trunk, median sigma 0.050 m in place and 0.010 m in radius; 1 other"));
}

TEST(Verdict, TellsTheSigmasOfTrunksAmongThemselvesAndThatOfTheScaleApart)
{
  RunSummary summary = goodRun();
  TrunkRecord &trunk = summary.trunks[0];
  summary.reference.scale = ScaleSource::prior;
  summary.reference.scale_sigma = 0.15;
  summary.first_place = {1, 2};
  trunk.xy = {9, -4};
  trunk.radius = 0.2;
  Eigen::Matrix<double, 5, 1> by_scale;
  by_scale << 8, -6, 0.2, 0, 0; // from the first place
  by_scale *= summary.reference.scale_sigma;
  trunk.covariance += by_scale * by_scale.transpose();
  ASSERT_GT(trunk.positionSigma(), 1.5);
  EXPECT_THAT(textOf(summary), HasSubstr("(+- 15 %)"));
  EXPECT_THAT(textOf(summary), HasSubstr("median sigma 0.050 m in place and 0.010 m in radius at this scale; 1 other"));
}

TEST(Verdict, TellsWhichFramesWereNotOkAndOfTimesWithoutAPicture)
{
  RunSummary summary = goodRun();
  summary.gaps = {{5, 2}};
  EXPECT_THAT(textOf(summary), HasSubstr("100 frames, all ok; no picture for 2.0 s from 5.0 s on\n"));
  summary.frames[FrameStatus::corrupt] = 40;
  summary.reasons[FrameStatus::corrupt] = "ends early";
  summary.gaps.push_back({8, 3});
  EXPECT_THAT(textOf(summary), HasSubstr("100 of 140 frames ok, 40 corrupt (ends early); no picture for 3.0 s from 8.0 "
                                         "s on, the longest of 2 gaps\n"));
  EXPECT_THAT(textOf(summary), HasSubstr("Many frames could not be used"));
  EXPECT_TRUE(judge(summary).is_trusted); // like frames that are missing
}

TEST(Verdict, OffersToLeaveOutASensorButNotTheImages)
{
  RunSummary summary = goodRun();
  summary.sensors = {{"gyro", "bias", 0, "gyro: bias 0.05 rad/s"}, {"images", "rotation", 5, "images: contradict"}};
  EXPECT_FALSE(judge(summary).is_trusted);
  EXPECT_THAT(textOf(summary), HasSubstr("gyro: bias 0.05 rad/s: --without gyro would map without it."));
  EXPECT_THAT(textOf(summary), HasSubstr("images: contradict."));
  EXPECT_THAT(textOf(summary), testing::Not(HasSubstr("--without images")));
}

TEST(Verdict, NamesTheOptionThatWouldTellWhatIsGuessedAndHowWellAFieldOfViewWasMeasured)
{
  RunSummary summary = goodRun();
  EXPECT_THAT(textOf(summary), HasSubstr("degrees, calibrated"));
  summary.field_of_view_sigma_deg = 2.14;
  EXPECT_THAT(textOf(summary), testing::AllOf(HasSubstr("degrees, measured +- 2.1"), testing::Not(HasSubstr("guess"))));
  EXPECT_NEAR(nlohmann::json::parse(toJson(summary)).at("camera").at("field_of_view_sigma_deg").get<double>(), 2.14,
              1e-12);
  summary = goodRun();
  summary.reference.scale = ScaleSource::prior;
  summary.reference.scale_sigma = 0.19;
  summary.is_camera_known = false;
  for (const char *said : {"--camera-height", "+- 19 %", "--field-of-view"})
    EXPECT_THAT(textOf(summary), HasSubstr(said));
}

TEST(Verdict, ACameraThatOnlyRotatedIsNotTrustedAndHasNoLengths)
{
  RunSummary summary = goodRun();
  summary.reference.has_ranges = false;
  summary.rotated_deg = 40;
  EXPECT_FALSE(judge(summary).is_trusted);
  EXPECT_THAT(textOf(summary), testing::AllOf(HasSubstr("NOT TO BE TRUSTED"), HasSubstr("ONLY ROTATED, by 40 degrees"),
                                              testing::Not(HasSubstr(" m in place"))));
  const auto json = nlohmann::json::parse(toJson(summary));
  EXPECT_EQ(json.at("trusted"), false);
  EXPECT_TRUE(json.at("motion").at("path_m").is_null());
  EXPECT_FALSE(json.at("trunks").contains("median_of_confirmed"));
}

TEST(Verdict, ACameraThatNeverMovedOrSawOrFoundNothingIsNotTrustedAndHasNoMedianOfZero)
{
  RunSummary still = goodRun(), blind = still, meadow = still;
  still.extent_m = 0.02;
  EXPECT_FALSE(judge(still).is_trusted);
  EXPECT_THAT(textOf(still), HasSubstr("NEVER MOVED"));
  blind.frames = {{FrameStatus::corrupt, 100}};
  EXPECT_FALSE(judge(blind).is_trusted);
  EXPECT_THAT(textOf(blind), testing::AllOf(HasSubstr("SAW NOTHING"), testing::Not(HasSubstr("field of view")),
                                            testing::Not(HasSubstr("a frame")), testing::Not(HasSubstr("lengths"))));
  meadow.trunks = {TrunkRecord()};
  EXPECT_THAT(textOf(meadow),
              testing::AllOf(HasSubstr("0 trunks, median sigma - in place"), HasSubstr("No trunk was confirmed")));
  const auto json = nlohmann::json::parse(toJson(meadow));
  EXPECT_TRUE(json.at("trunks").at("median_of_confirmed").at("radius_m").is_null());
  EXPECT_TRUE(json.at("timing").at("median_frame_ms").is_null());
  meadow.trunks.clear();
  EXPECT_FALSE(judge(meadow).is_trusted);
}

TEST(Summary, HoldsWhatTheRunCanBeRedoneWith)
{
  RunSummary summary = goodRun();
  summary.command = {"bole", "track", "flight", "-o", "run"};
  summary.options = "map:\n  lag: 0\n";
  summary.digest = InputDigest{12, "abc"};
  const auto json = nlohmann::json::parse(toJson(summary));
  EXPECT_EQ(json.at("command").size(), 5u);
  EXPECT_EQ(json.at("options"), summary.options);
  EXPECT_EQ(json.at("input").at("bytes"), 12);
  EXPECT_EQ(json.at("input").at("sha256"), "abc");
  for (const char *part : {"bole", "commit", "visp", "opencv", "libav"})
    EXPECT_FALSE(json.at("versions").at(part).get<std::string>().empty()) << part;
}

TEST(InputDigest, IsTheSha256OfAFile)
{
  const test::TemporaryFolder folder;
  const auto digest = digestOf(folder.write("digest.txt", "abc"), std::atomic<bool>(false));
  ASSERT_TRUE(digest);
  EXPECT_EQ(digest->bytes, 3u);
  EXPECT_EQ(digest->sha256, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"); // FIPS 180-2, B.1
}

TEST(InputDigest, OfAFolderFollowsNamesAndContentAndThatOfNothingIsNone)
{
  const test::TemporaryFolder folder;
  folder.write("a", "1");
  folder.write("sub/b", "23");
  const std::atomic<bool> go(false), stop(true);
  const auto first = digestOf(folder.path(), go);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->bytes, 3u);
  EXPECT_EQ(digestOf(folder.path(), go)->sha256, first->sha256);
  std::filesystem::rename(folder / "a", folder / "c");
  EXPECT_NE(digestOf(folder.path(), go)->sha256, first->sha256);
  EXPECT_EQ(digestOf(folder / "%05d.png", go)->bytes, 1u + 2u);
  EXPECT_FALSE(digestOf(folder.path(), stop));
  EXPECT_FALSE(digestOf("ardrone://192.168.1.1", go));
}
