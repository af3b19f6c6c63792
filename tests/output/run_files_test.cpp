// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/so3.h"
#include "output/atomic_file.h"
#include "output/trajectory_writer.h"
#include "output/trunks_csv.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <iterator>
#include <visp3/core/vpException.h>

using namespace bole;
namespace fs = std::filesystem;

namespace
{
class RunFiles : public testing::Test
{
protected:
  RunFiles()
  {
    std::string pattern = (fs::temp_directory_path() / "bole-run-XXXXXX").string();
    m_folder = mkdtemp(pattern.data());
  }
  ~RunFiles() override { fs::remove_all(m_folder); }

  std::string path(const std::string &name) const { return (m_folder / name).string(); }
  std::string content(const std::string &name) const
  {
    std::ifstream file(path(name), std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }
  std::size_t files() const
  {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(m_folder), fs::directory_iterator()));
  }

  fs::path m_folder;
};
} // namespace

TEST_F(RunFiles, AnAtomicFileThatIsNotCommittedLeavesTheOldOne)
{
  writeAtomically(path("a.txt"), "old");
  {
    AtomicFile file(path("a.txt"));
    std::ofstream(file.temporaryPath()) << "half";
    EXPECT_EQ(fs::path(file.temporaryPath()).extension(), ".txt");
  }
  EXPECT_EQ(content("a.txt"), "old");
  EXPECT_EQ(files(), 1u);
}

TEST_F(RunFiles, AnAtomicFileIsThereWholeAfterCommit)
{
  writeAtomically(path("a.txt"), "old");
  AtomicFile file(path("a.txt"));
  std::ofstream(file.temporaryPath()) << "new";
  EXPECT_EQ(content("a.txt"), "old");
  file.commit();
  EXPECT_EQ(content("a.txt"), "new");
  EXPECT_EQ(files(), 1u);
}

TEST_F(RunFiles, NamesTheFileThatCannotBeWritten)
{
  try {
    writeAtomically(path("none/a.txt"), "x");
    FAIL() << "no exception";
  }
  catch (const vpException &error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("none/a.txt"));
  }
}

TEST_F(RunFiles, TrajectoriesComeBackWithExactStamps)
{
  Trajectory trajectory;
  for (int i = 0; i < 20; ++i)
    trajectory.push_back({1403636579763555584LL + i * 50000001LL,
                          Pose(expSo3({0.3 * i, -0.1 * i, 0.2 * i}), {0.1 * i, -2.0 * i, 1e-3 * i})});
  writeTrajectory(path("t.tum"), trajectory);

  const Trajectory read = readTumTrajectory(path("t.tum"));

  ASSERT_EQ(read.size(), trajectory.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read[i].stamp_ns, trajectory[i].stamp_ns);
    EXPECT_LT(read[i].wMb.minus(trajectory[i].wMb).norm(), 1e-8);
  }
}

TEST_F(RunFiles, StampsBeforeZeroComeBackToo)
{
  writeTrajectory(path("t.tum"), {{-1500000000, Pose()}, {-500000000, Pose()}, {250000000, Pose()}});
  const Trajectory read = readTumTrajectory(path("t.tum"));
  ASSERT_EQ(read.size(), 3u);
  EXPECT_EQ(read[0].stamp_ns, -1500000000);
  EXPECT_EQ(read[1].stamp_ns, -500000000);
}

TEST_F(RunFiles, TrunksComeBack)
{
  TrunkRecord trunk;
  trunk.id = 3;
  trunk.xy = {1.5, -2.25};
  trunk.radius = 0.125;
  trunk.covariance_xy << 0.04, -0.01, -0.01, 0.02;
  trunk.variance_radius = 1e-4;
  trunk.observations = 17;
  trunk.first_seen_s = 0.4;
  trunk.last_seen_s = 3.1;
  trunk.status = TrunkStatus::merged;
  writeTrunks(path("trunks.csv"), {trunk, trunk});

  EXPECT_THAT(content("trunks.csv"),
              testing::StartsWith("id,x [m],y [m],radius [m],var_xx [m^2],var_xy [m^2],var_yy [m^2],var_radius "
                                  "[m^2],observations,first_seen [s],last_seen [s],status\n3,1.500000,-2.250000,"));
  const auto read = readTrunks(path("trunks.csv"));
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].id, 3);
  EXPECT_LT((read[0].covariance_xy - trunk.covariance_xy).norm(), 1e-9);
  EXPECT_EQ(read[0].status, TrunkStatus::merged);
  EXPECT_DOUBLE_EQ(read[0].last_seen_s, 3.1);
}

TEST_F(RunFiles, TheThinnestTrunkStillComesBack)
{
  TrunkRecord thread; // a candidate may shrink to anything before it is given up
  thread.radius = 3e-8;
  writeTrunks(path("thin.csv"), {thread});
  EXPECT_DOUBLE_EQ(readTrunks(path("thin.csv")).at(0).radius, 3e-8);
}

TEST_F(RunFiles, RefusesTrunksThatAreNone)
{
  const std::string header = std::string(kTrunksCsvHeader) + "\n";
  for (const auto &[text, message] : std::vector<std::pair<std::string, std::string>>{
           {"id,x\n", "trunks.csv:1: the header"},
           {header + "0,1,2,-0.1,1,0,1,1,5,0,1,confirmed\n", "trunks.csv:2: radius"},
           {header + "0,1,2,0.1,1,2,1,1,5,0,1,confirmed\n", "trunks.csv:2: var_xx"},
           {header + "0,1,2,0.1,1,0,1,1,5,0,1,found\n", "trunks.csv:2: status = \"found\""},
           {header + "0,nan,2,0.1,1,0,1,1,5,0,1,confirmed\n", "trunks.csv:2: x = \"nan\""}}) {
    writeAtomically(path("trunks.csv"), text);
    try {
      readTrunks(path("trunks.csv"));
      ADD_FAILURE() << text;
    }
    catch (const vpException &error) {
      EXPECT_THAT(error.what(), testing::HasSubstr(message));
    }
  }
}
