// SPDX-License-Identifier: GPL-2.0-or-later
// setup.sh on machines that lack something: its tools are replaced, and nothing is installed or built.
#include "support/shell.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <unistd.h>

namespace
{
namespace fs = std::filesystem;
using bole::test::Outcome;
using testing::HasSubstr;
using testing::Not;

/// A machine of a user without root's rights on which no package is installed.
class Setup : public testing::Test
{
protected:
  void SetUp() override
  {
    fs::remove_all(m_tools);
    fs::create_directories(m_tools);
    fs::permissions(m_tools, fs::perms::all);
    fs::copy(BOLE_SOURCE_DIR "/setup.sh", m_tools);
    for (const char *name : {"sh", "id", "dirname", "grep", "date", "mktemp", "rm", "tail", "env", "sleep"})
      tool(name, "exec $(PATH=/usr/bin:/bin command -v " + std::string(name) + ") \"$@\"");
    tool("dpkg-query", "exit 1");
    tool("cmake", "echo BUILT; exit 1");
    tool("apt-get", "exit 0");
  }
  void TearDown() override { fs::remove_all(m_tools); }

  void tool(const std::string &name, const std::string &script)
  {
    std::ofstream(m_tools / name) << "#!/bin/sh\n" << script << "\n";
    fs::permissions(m_tools / name, fs::perms::all);
  }
  void sudo() { tool("sudo", "[ \"$1\" = -v ] || exec \"$@\""); }

  Outcome setup(const std::string &words) const
  {
    const std::string as_user = ::geteuid() == 0 ? "setpriv --reuid=65534 --regid=65534 --clear-groups " : "";
    return bole::test::runShell(as_user + "/usr/bin/env PATH=" + m_tools.string() + " HOME=/ TMPDIR=" +
                                m_tools.string() + " " + (m_tools / "setup.sh").string() + " " + words);
  }

  const fs::path m_tools = testing::TempDir() + "bole_setup_" + std::to_string(::getpid());
};

TEST_F(Setup, TellsWhatThereIs)
{
  const Outcome outcome = setup("--help");
  EXPECT_EQ(outcome.status, 0);
  EXPECT_THAT(outcome.text, HasSubstr("./setup.sh install [PREFIX]"));
  EXPECT_EQ(setup("").status, 2);
}

TEST_F(Setup, NamesAWordThatItDoesNotKnow)
{
  const Outcome outcome = setup("tset");
  EXPECT_EQ(outcome.status, 2);
  EXPECT_THAT(outcome.text, HasSubstr("no such word: tset; did you mean test?"));
  EXPECT_THAT(setup("xyz").text, HasSubstr("no such word: xyz ("));
  EXPECT_THAT(setup("demo twice").text, HasSubstr("too many words: demo twice"));
}

TEST_F(Setup, WithoutSudoNamesThePackagesThatRootMustInstall)
{
  const Outcome outcome = setup("demo");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.text, HasSubstr("as root: apt-get install g++ cmake"));
  EXPECT_THAT(outcome.text, Not(HasSubstr("not found")));
}

TEST_F(Setup, AsksForTheRightToInstallBeforeItBuilds)
{
  tool("dpkg-query", "echo install ok installed");
  const Outcome refused = setup("install /proc/bole");
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.text, HasSubstr("/proc/bole is root's to write"));
  EXPECT_THAT(refused.text, Not(HasSubstr("BUILT")));
  EXPECT_THAT(setup("install " + (m_tools / "prefix").string()).text, HasSubstr("BUILT"));
}

TEST_F(Setup, WithoutANetworkSaysSoInOneLine)
{
  sudo();
  tool("apt-get",
       "for i in 1 2 3; do echo \"Err:$i http://deb.debian.org bookworm\"; done\n"
       "case \"$*\" in *update*) echo 'W: Failed to fetch http://deb.debian.org/x  Temporary failure'; exit 0;; "
       "*) echo 'E: Unable to locate package libvisp-dev'; exit 100;; esac");
  const Outcome outcome = setup("demo");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.text,
              HasSubstr("setup.sh: apt-get: W: Failed to fetch http://deb.debian.org/x  Temporary failure"));
  EXPECT_THAT(outcome.text, Not(HasSubstr("Err:")));
}

TEST_F(Setup, WaitsUntilAnotherAptIsDone)
{
  sudo();
  tool("sleep", "exit 0");
  const std::string count = (m_tools / "count").string();
  tool("apt-get", "echo >>" + count + "\n[ $(grep -c '' " + count +
                      ") -gt 3 ] || { echo 'E: Could not get lock /var/lib/apt/lists/lock. It is held by 7'; "
                      "echo 'E: Unable to lock directory /var/lib/apt/lists/'; exit 100; }");
  EXPECT_THAT(setup("demo").text, HasSubstr("BUILT"));
}
} // namespace
