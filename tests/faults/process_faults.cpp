// SPDX-License-Identifier: GPL-2.0-or-later
// What happens to a process: signals, a full disk, a small stack, a reader that goes away, two at once.
#include "fault_list.h"

#include "support/files.h"
#include "support/shell.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <fmt/format.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace bole::faults
{
namespace
{
namespace fs = std::filesystem;

std::size_t posesIn(const fs::path &run)
{
  const std::vector<std::string> lines = test::linesOf(run / "trajectory.tum");
  return static_cast<std::size_t>(
      std::count_if(lines.begin(), lines.end(), [](const std::string &line) { return line.front() != '#'; }));
}

std::size_t hiddenIn(const fs::path &run)
{
  std::size_t count = 0;
  for (const auto &entry : fs::directory_iterator(run))
    count += entry.path().filename().string().front() == '.';
  return count;
}

std::string trackOf(const Shop &shop, const std::string &run, const std::string &more = " --no-video")
{
  return shop.bole + " track " + shop.flight + " -o " + run + more;
}

/// A run that gets \p signal when it has written a pose: later a quick one may have ended. \return its status as
/// waitpid() tells it.
int runUntil(const Shop &shop, const std::string &run, int signal)
{
  const pid_t child = fork();
  if (child == 0) {
    for (const int each : {SIGHUP, SIGINT, SIGPIPE, SIGTERM})
      std::signal(each, SIG_DFL); // whoever runs this may ignore them
    if (freopen("/dev/null", "w", stderr) && freopen("/dev/null", "w", stdout))
      execl(shop.bole.c_str(), "bole", "track", shop.flight.c_str(), "-o", run.c_str(), "--no-video", nullptr);
    _exit(127);
  }
  const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(300);
  while (posesIn(run) == 0 && std::chrono::steady_clock::now() < give_up)
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  kill(child, signal);
  int status = 0;
  waitpid(child, &status, 0);
  return status;
}

Fault process(const std::string &name, const std::string &what, const std::function<Seen(const Shop &)> &seen)
{
  return {"process", name, what, Duty::keep, {}, {}, {}, seen};
}

Fault interrupted(const std::string &name, int signal)
{
  return process(name, "", [signal](const Shop &shop) {
    const std::string run = shop.folder + "/run";
    const int status = runUntil(shop, run, signal);
    const std::size_t poses = posesIn(run);
    const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    const bool is_told = test::textOf(run + "/summary.json").find("interrupted") != std::string::npos;
    return Seen{code == 130 && poses > 0 && is_told && fs::exists(run + "/trunks.csv") && hiddenIn(run) == 0,
                fmt::format("exit {}, {} poses kept", code, poses)};
  });
}

Seen killedAndResumed(const Shop &shop)
{
  const std::string run = shop.folder + "/run", whole = shop.folder + "/whole";
  runUntil(shop, run, SIGKILL);
  std::ofstream(run + "/.overlay.partial.mp4") << "half";
  const std::size_t kept = posesIn(run);
  const int resumed = test::runShell(shop.bole + " track -q --resume " + run).status;
  const int unbroken = test::runShell(trackOf(shop, whole, " --no-video -q")).status;
  bool is_same = resumed == 0 && unbroken == 0 && kept > 0;
  for (const char *file : {"/trajectory.tum", "/trunks.csv", "/graph.g2o"})
    is_same = is_same && test::textOf(run + file) == test::textOf(whole + file);
  return {is_same && hiddenIn(run) == 0, fmt::format("{} poses kept; --resume: exit {}, {}", kept, resumed,
                                                     is_same ? "the same bytes" : "OTHER BYTES")};
}

Seen fullDisk(const Shop &shop)
{
  const std::string run = shop.folder + "/run";
  // no file may grow beyond 256 kB (512 bytes a block): the videos would
  const test::Outcome outcome = test::runShell("ulimit -f 500; " + trackOf(shop, run, " --frames 40"));
  return {outcome.status == 0 && outcome.text.find("without videos") != std::string::npos && posesIn(run) == 40 &&
              hiddenIn(run) == 0,
          fmt::format("exit {}, {} poses, warned", outcome.status, posesIn(run))};
}

Seen smallStack(const Shop &shop)
{
  const std::string run = shop.folder + "/run";
  const test::Outcome outcome = test::runShell("ulimit -s 64; " + trackOf(shop, run, " --frames 30"));
  return {outcome.status == 0 && posesIn(run) == 30, fmt::format("exit {}, {} poses", outcome.status, posesIn(run))};
}

Seen noReader(const Shop &shop)
{
  const std::string run = shop.folder + "/run";
  const int status = test::runShell("(" + trackOf(shop, run, " --no-video --frames 30") + "; echo $? > " + shop.folder +
                                    "/status) | true")
                         .status;
  const std::string code = test::textOf(shop.folder + "/status");
  const bool is_complete = test::textOf(run + "/summary.json").find("\"complete\": true") != std::string::npos;
  return {status == 0 && is_complete && code == "0\n",
          fmt::format("exit {}, {}", code.substr(0, code.find('\n')), is_complete ? "complete" : "NOT COMPLETE")};
}

Seen twoAtOnce(const Shop &shop)
{
  const std::string run = shop.folder + "/run", line = trackOf(shop, run, " --no-video -q --frames 60");
  const test::Outcome outcome =
      test::runShell(line + " & first=$!; " + line + "; a=$?; wait $first; echo exits $((a + $?))");
  const bool is_told = outcome.text.find("another run writes into this folder") != std::string::npos &&
                       outcome.text.find("exits 1") != std::string::npos; // whichever came first
  return {is_told && posesIn(run) == 60, is_told ? "one of them is told so" : outcome.text.substr(0, 80)};
}

Seen noHangup(const Shop &shop)
{
  const std::string run = shop.folder + "/run";
  const test::Outcome outcome =
      test::runShell("trap '' HUP; " + trackOf(shop, run, " --no-video -q") + " & child=$!; while [ ! -e " + run +
                     "/summary.json ]; do sleep 0.01; done; kill -HUP $child; wait $child; echo ended $?");
  return {outcome.text.find("ended 0") != std::string::npos, "it goes on to its end"};
}
} // namespace

std::vector<Fault> processFaults()
{
  return {interrupted("SIGINT", SIGINT),
          interrupted("SIGTERM", SIGTERM),
          interrupted("SIGHUP", SIGHUP),
          interrupted("SIGPIPE", SIGPIPE),
          process("kill -9", "", killedAndResumed),
          process("nohup", "and SIGHUP", noHangup),
          process("full_disk", "at 256 kB a file", fullDisk),
          process("stack_64k", "", smallStack),
          process("closed_output", "", noReader),
          process("two_at_once", "in one folder", twoAtOnce)};
}
} // namespace bole::faults
