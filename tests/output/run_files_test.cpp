// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "geometry/so3.h"
#include "input/atomic_file.h"
#include "input/trajectory.h"
#include "output/flight_trace.h"
#include "output/trunks_csv.h"

using namespace bole;
namespace fs = std::filesystem;

namespace
{
class RunFiles : public testing::Test
{
protected:
  std::string path(const std::string &name) const { return m_folder / name; }
  std::string content(const std::string &name) const { return test::textOf(path(name)); }
  std::size_t files() const
  {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(m_folder.path()), fs::directory_iterator()));
  }

  test::TemporaryFolder m_folder;
};
} // namespace

TEST_F(RunFiles, AnAtomicFileTakesThePlaceOfTheOldOneOnlyWhenItIsCommitted)
{
  writeAtomically(path("a.txt"), "old");
  for (const bool is_committed : {false, true}) {
    {
      AtomicFile file(path("a.txt"));
      std::ofstream(file.temporaryPath()) << "new";
      EXPECT_EQ(fs::path(file.temporaryPath()).extension(), ".txt");
      EXPECT_EQ(content("a.txt"), "old");
      if (is_committed)
        file.commit();
    }
    EXPECT_EQ(content("a.txt"), is_committed ? "new" : "old");
    EXPECT_EQ(files(), 1u);
  }
  EXPECT_REFUSED("none/a.txt", writeAtomically(path("none/a.txt"), "x"));
}

TEST_F(RunFiles, TheReasonOfAFrameComesBackWhateverItSays)
{
  const std::vector<std::string> reasons = {"image of 640x480 px, must be 320x240", "woods; north, \"a\"/7.png", "a\nb",
                                            ""};
  FlightTrace trace;
  for (std::size_t i = 0; i < reasons.size(); ++i) {
    trace.frames.emplace_back();
    trace.frames.back().stamp_ns = static_cast<std::int64_t>(i);
    trace.frames.back().reason = reasons[i];
  }
  writeTrace(m_folder.path(), trace);
  const std::vector<FrameTrace> read = readFrames(m_folder.path());
  ASSERT_EQ(read.size(), reasons.size());
  for (std::size_t i = 0; i < reasons.size(); ++i)
    EXPECT_EQ(read[i].reason, reasons[i]);
}

TEST_F(RunFiles, TrajectoriesComeBackWithExactStampsAlsoFromBeforeZero)
{
  for (const std::int64_t begin_ns : {1403636579763555584LL, -1500000000LL}) {
    Trajectory trajectory;
    for (int i = 0; i < 40; ++i)
      trajectory.push_back(
          {begin_ns + i * 50000001LL, Pose(expSo3({0.3 * i, -0.1 * i, 0.2 * i}), {0.1 * i, -2.0 * i, 1e-3 * i})});
    writeTrajectory(path("t.tum"), trajectory);

    const Trajectory read = readTumTrajectory(path("t.tum"));

    ASSERT_EQ(read.size(), trajectory.size());
    for (std::size_t i = 0; i < read.size(); ++i) {
      EXPECT_EQ(read[i].stamp_ns, trajectory[i].stamp_ns);
      EXPECT_LT(read[i].wMb.minus(trajectory[i].wMb).norm(), 1e-8);
    }
  }
}

namespace
{
TrunkRecord confirmedTrunk()
{
  TrunkRecord trunk;
  trunk.id = 3;
  trunk.status = TrunkStatus::confirmed;
  trunk.xy = {1.5, -2.25};
  trunk.radius = 0.125;
  trunk.lean = {0.01, -0.02};
  trunk.ground_z = -0.25;
  trunk.probability = 0.875;
  Eigen::Matrix<double, 5, 5> root;
  for (int i = 0; i < 25; ++i)
    root(i / 5, i % 5) = 0.01 * ((7 * i) % 11 - 5);
  trunk.covariance = root * root.transpose();
  trunk.observations = 17;
  trunk.first_seen_s = 0.4;
  trunk.last_seen_s = 3.1;
  return trunk;
}
} // namespace

TEST_F(RunFiles, TrunksComeBackWithTheirWholeCovariance)
{
  const TrunkRecord trunk = confirmedTrunk();
  writeTrunks(path("trunks.csv"), {trunk, trunk});
  const auto read = readTrunks(path("trunks.csv"));
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].id, 3);
  EXPECT_LT((read[0].covariance - trunk.covariance).norm(), 1e-6 * trunk.covariance.norm());
  EXPECT_LT((read[0].lean - trunk.lean).norm(), 1e-9);
  EXPECT_EQ(read[0].status, TrunkStatus::confirmed);
  EXPECT_DOUBLE_EQ(read[0].ground_z, -0.25);
  EXPECT_DOUBLE_EQ(read[0].probability, 0.875);
  EXPECT_EQ(read[0].observations, 17);
  EXPECT_DOUBLE_EQ(read[0].last_seen_s, 3.1);
}

TEST_F(RunFiles, TrunksCsvHoldsTrunksAndHypothesesCsvTheRestWithTheReason)
{
  TrunkRecord outdone = confirmedTrunk();
  outdone.id = 8;
  outdone.status = TrunkStatus::lost;
  outdone.reject_reason = RejectReason::outdone;
  const std::vector<TrunkRecord> map = {confirmedTrunk(), outdone};
  writeTrunks(path("trunks.csv"), map);
  writeHypotheses(path("hypotheses.csv"), map);
  const auto trunks = readTrunks(path("trunks.csv")), rest = readTrunks(path("hypotheses.csv"));
  ASSERT_EQ(trunks.size(), 1u);
  EXPECT_EQ(trunks[0].id, 3);
  ASSERT_EQ(rest.size(), 1u);
  EXPECT_EQ(rest[0].id, 8);
  EXPECT_EQ(rest[0].reject_reason, RejectReason::outdone);
  TrunkRecord thread; // a candidate may shrink to anything before it is rejected
  thread.radius = 3e-8;
  writeHypotheses(path("thin.csv"), {thread});
  EXPECT_DOUBLE_EQ(readTrunks(path("thin.csv")).at(0).radius, 3e-8);
}

TEST_F(RunFiles, EveryColumnHasAUnitInALineThatBeginsAsAComment)
{
  writeTrunks(path("trunks.csv"), {confirmedTrunk()});
  writeHypotheses(path("hypotheses.csv"), {TrunkRecord()});
  for (const char *name : {"trunks.csv", "hypotheses.csv"}) {
    std::istringstream lines(content(name));
    std::vector<std::ptrdiff_t> commas;
    std::string line;
    for (int i = 0; std::getline(lines, line); ++i) {
      EXPECT_EQ(line[0] == '#', i == 1) << line;
      commas.push_back(std::count(line.begin(), line.end(), ','));
    }
    EXPECT_THAT(commas, testing::AllOf(testing::SizeIs(3), testing::Each(commas.at(0)))) << name;
    EXPECT_THAT(content(name).substr(0, content(name).find('\n')), testing::Not(testing::HasSubstr("["))) << name;
  }
}

TEST_F(RunFiles, ARotatedCamerasTrunksHaveABearingAndAWidth)
{
  TrunkRecord trunk = confirmedTrunk();
  trunk.xy = {1, 3};
  trunk.radius = 0.2;
  trunk.covariance.setZero();
  trunk.covariance(0, 0) = 0.09; // across the line of sight, 2 m away
  writeBearings(path("bearings.csv"), {trunk, TrunkRecord()}, {1, 1});
  EXPECT_THAT(content("bearings.csv"), testing::HasSubstr("\n3,confirmed,90.0000,11.4783,8.5944,0.0000,17\n"));
  EXPECT_THAT(content("bearings.csv"), testing::Not(testing::HasSubstr("candidate")));
}

TEST_F(RunFiles, RefusesTrunksThatAreNone)
{
  writeTrunks(path("trunks.csv"), {confirmedTrunk()});
  const std::string good = content("trunks.csv");
  const auto with = [&good](const std::string &old, const std::string &text) {
    std::string changed = good;
    changed.replace(changed.find(old), old.size(), text);
    return changed;
  };
  for (const auto &[text, message] : std::vector<std::pair<std::string, std::string>>{
           {"id,x\n", "trunks.csv:1: the header"},
           {with(",0.125,", ",-0.1,"), "trunks.csv:3: radius"},
           {with("\n3,confirmed", "\n3,found"), "trunks.csv:3: status = \"found\""},
           {with(",1.500000,", ",nan,"), "trunks.csv:3: x = \"nan\""},
           {with(fmt::format(",{:.6e},", confirmedTrunk().covariance(0, 0)), ",-1,"), "trunks.csv:3: var_xx"}}) {
    writeAtomically(path("trunks.csv"), text);
    EXPECT_REFUSED(message, readTrunks(path("trunks.csv"))) << text;
  }
}
