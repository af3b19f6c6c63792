// SPDX-License-Identifier: GPL-2.0-or-later
// A run that is killed leaves either the old files or complete new ones.
#include "run_bole.h"
#include "support/test.h"

#include "input/recorded_source.h"
#include <chrono>
#include <csignal>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace
{
namespace fs = std::filesystem;
using namespace bole::test;
using testing::HasSubstr;

pid_t start(const std::vector<std::string> &arguments)
{
  const pid_t child = fork();
  if (child == 0) {
    std::vector<char *> argv = {const_cast<char *>(BOLE_EXECUTABLE)};
    for (const std::string &argument : arguments)
      argv.push_back(const_cast<char *>(argument.c_str()));
    argv.push_back(nullptr);
    if (freopen("/dev/null", "w", stderr) && freopen("/dev/null", "w", stdout))
      execv(BOLE_EXECUTABLE, argv.data());
    _exit(127);
  }
  return child;
}

int statusOf(pid_t child)
{
  int status = 0;
  waitpid(child, &status, 0);
  return status;
}

std::vector<std::string> rowsOf(const std::string &path)
{
  std::vector<std::string> rows = linesOf(path);
  rows.erase(std::remove_if(rows.begin(), rows.end(), [](const auto &row) { return !row.empty() && row[0] == '#'; }),
             rows.end());
  return rows;
}

std::size_t fieldsIn(const std::string &line, char separator)
{
  std::size_t count = 0;
  std::istringstream fields(line);
  for (std::string field; std::getline(fields, field, separator);)
    ++count;
  return count;
}

std::size_t picturesIn(const std::string &path)
{
  bole::VideoSource video(path);
  std::size_t count = 0;
  for (;;) {
    bole::Frame frame;
    if (!video.next(frame))
      return count;
    count += frame.status == bole::FrameStatus::ok || frame.status == bole::FrameStatus::stale;
  }
}

/// Kills `bole` with \p arguments as soon as \p is_enough.
void killAsSoonAs(const std::vector<std::string> &arguments, const std::function<bool()> &is_enough)
{
  const pid_t child = start(arguments);
  const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(120);
  while (!is_enough() && std::chrono::steady_clock::now() < give_up)
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  kill(child, SIGKILL);
  ASSERT_TRUE(WIFSIGNALED(statusOf(child))) << "it was over before it was killed";
}

/// Frames that the run in \p folder knows; -1 where there is none yet.
int framesOf(const std::string &folder)
{
  auto summary = nlohmann::json::parse(std::ifstream(folder + "/summary.json"), nullptr, false);
  return summary.contains("frames") ? summary["frames"]["all"].get<int>() : -1;
}

TEST(Kill, OfARunLeavesWhatIsShownExportedRepeatedAndCompleted)
{
  const std::string folder = freshFolder("killed");
  killAsSoonAs({"track", kFlight, "-o", folder, "--no-video"}, [&] { return framesOf(folder) > 0; });
  ASSERT_EQ(framesOf(folder), 1); // the next time is after 50
  for (const std::string &command :
       {"report " + folder + " " + kFlight, "export " + folder + " tum", "export " + folder + " colmap",
        "export " + folder + " g2o", "graph " + folder, "evaluate " + folder + " " + kFlight}) {
    const Outcome outcome = run(command);
    EXPECT_EQ(outcome.status, 0) << command << ": " << outcome.text;
  }
  const Outcome again = run("track --again " + folder);
  EXPECT_EQ(again.status, 0) << again.text;
  const Outcome resumed = run("track --resume " + folder);
  EXPECT_EQ(resumed.status, 0) << resumed.text;
  EXPECT_EQ(framesOf(folder), 120);
  EXPECT_EQ(jsonOf(folder + "/summary.json").at("complete"), true);
}

TEST(Kill, OfARunBeforeItsFirstFrameIsSaidInALineAndCompleted)
{
  const std::string folder = freshFolder("killed_early");
  killAsSoonAs({"track", kFlight, "-o", folder, "--no-video", "--frames", "20"}, [&] { return framesOf(folder) >= 0; });
  auto summary = jsonOf(folder + "/summary.json");
  summary["frames"]["all"] = 0;
  fs::remove_all(folder);
  fs::create_directories(folder);
  std::ofstream(folder + "/summary.json") << summary;
  for (const std::string &command : {"report " + folder, "export " + folder + " tum",
                                     "evaluate " + folder + " " + kFlight, "track --again " + folder}) {
    const Outcome outcome = run(command);
    EXPECT_EQ(outcome.status, 1) << command;
    EXPECT_THAT(outcome.text, HasSubstr("ended before its first frame")) << command;
    EXPECT_EQ(std::count(outcome.text.begin(), outcome.text.end(), '\n'), 1) << command;
  }
  EXPECT_THAT(run("track --resume " + folder).status, testing::AnyOf(0, 3));
  EXPECT_EQ(framesOf(folder), 20);
}

TEST(Kill, OfAFollowerLeavesEachFrameUntilThen)
{
  const std::string folder = freshFolder("killed_follow"), model = folder + "_wood.cao";
  std::ofstream(model) << "V1\n2\n4 1 0\n4 1 4\n0\n0\n0\n1\n0 1 0.2\n0\n";
  const auto rows = [&] { return rowsOf(folder + "/status.csv"); };
  killAsSoonAs({"follow", kFlight, "--model", model, "--init", "0,1.19,1.12,-6.4", "-o", folder},
               [&] { return rows().size() > 6; });
  const auto lines = rows();
  ASSERT_GT(lines.size(), 6u);
  for (const std::string &line : lines)
    EXPECT_GE(fieldsIn(line, ','), 8u) << line;
  EXPECT_TRUE(fs::exists(folder + "/trajectory.tum"));
  EXPECT_EQ(jsonOf(folder + "/follow.json").at("complete"), false);
}

TEST(Kill, LeavesOldOrCompleteFiles)
{
  const std::string run = testing::TempDir() + "bole_kill";
  fs::remove_all(run);
  ASSERT_EQ(statusOf(start({"track", kFlight, "-o", run, "--frames", "10"})), 0);
  ASSERT_EQ(rowsOf(run + "/trajectory.tum").size(), 10u);

  // what is known is written every 50 frames: killed some time after the first of these
  killAsSoonAs({"track", kFlight, "-o", run}, [&] { return rowsOf(run + "/trajectory.tum").size() != 10; });

  for (const char *name : {"/trajectory.tum", "/trajectory_online.tum"}) {
    const auto lines = rowsOf(run + name);
    EXPECT_THAT(lines.size(), testing::AnyOf(10u, 50u, 100u)) << name;
    for (const std::string &line : lines)
      EXPECT_EQ(fieldsIn(line, ' '), 8u) << name << ": " << line;
  }
  for (const char *name : {"/trunks.csv", "/hypotheses.csv"}) {
    const auto lines = rowsOf(run + name);
    ASSERT_FALSE(lines.empty()) << name;
    for (const std::string &line : lines)
      EXPECT_EQ(fieldsIn(line, ','), fieldsIn(lines[0], ',')) << line;
  }
  const auto timing = rowsOf(run + "/timing.csv");
  ASSERT_GE(timing.size(), 11u);
  for (const std::string &line : timing)
    EXPECT_EQ(fieldsIn(line, ','), fieldsIn(timing[0], ',')) << line;
  EXPECT_NO_THROW({ const auto summary = nlohmann::json::parse(std::ifstream(run + "/summary.json")); });
  EXPECT_EQ(rowsOf(run + "/map.svg").back(), "</svg>");
  EXPECT_EQ(picturesIn(run + "/overlay.mp4"), 10u); // the old one: a video is moved to its place when it is whole
}
} // namespace
