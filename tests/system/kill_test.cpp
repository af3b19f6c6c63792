// SPDX-License-Identifier: GPL-2.0-or-later
// A run that is killed leaves either the old files or complete new ones.
#include "input/video_source.h"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
#include <vector>

namespace
{
namespace fs = std::filesystem;
const std::string kFlight = BOLE_SOURCE_DIR "/data/park-forward";

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

/// Without comments.
std::vector<std::string> linesOf(const std::string &path)
{
  std::vector<std::string> lines;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);)
    if (line.empty() || line[0] != '#')
      lines.push_back(line);
  return lines;
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

TEST(Kill, LeavesOldOrCompleteFiles)
{
  const std::string run = testing::TempDir() + "bole_kill";
  fs::remove_all(run);
  ASSERT_EQ(statusOf(start({"track", kFlight, "-o", run, "--frames", "10"})), 0);
  ASSERT_EQ(linesOf(run + "/trajectory.tum").size(), 10u);

  const pid_t child = start({"track", kFlight, "-o", run});
  // what is known is written every 50 frames: killed some time after the first of these
  const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(120);
  while (linesOf(run + "/trajectory.tum").size() == 10 && std::chrono::steady_clock::now() < give_up)
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  kill(child, SIGKILL);
  const int status = statusOf(child);
  ASSERT_TRUE(WIFSIGNALED(status)) << "it was over before it was killed";

  for (const char *name : {"/trajectory.tum", "/trajectory_online.tum"}) {
    const auto lines = linesOf(run + name);
    EXPECT_THAT(lines.size(), testing::AnyOf(10u, 50u, 100u)) << name;
    for (const std::string &line : lines)
      EXPECT_EQ(fieldsIn(line, ' '), 8u) << name << ": " << line;
  }
  for (const char *name : {"/trunks.csv", "/hypotheses.csv"}) {
    const auto lines = linesOf(run + name);
    ASSERT_FALSE(lines.empty()) << name;
    for (const std::string &line : lines)
      EXPECT_EQ(fieldsIn(line, ','), fieldsIn(lines[0], ',')) << line;
  }
  const auto timing = linesOf(run + "/timing.csv");
  ASSERT_GE(timing.size(), 11u);
  for (const std::string &line : timing)
    EXPECT_EQ(fieldsIn(line, ','), fieldsIn(timing[0], ',')) << line;
  EXPECT_NO_THROW({ const auto summary = nlohmann::json::parse(std::ifstream(run + "/summary.json")); });
  EXPECT_EQ(linesOf(run + "/map.svg").back(), "</svg>");
  EXPECT_EQ(picturesIn(run + "/overlay.mp4"), 10u); // the old one: a video is moved to its place when it is whole
}
} // namespace
