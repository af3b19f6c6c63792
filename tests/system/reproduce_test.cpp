// SPDX-License-Identifier: GPL-2.0-or-later
// `bole reproduce` as its users run it, on a short simulated flight.
#include "support/shell.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <unistd.h>

namespace
{
namespace fs = std::filesystem;
using bole::test::Outcome;
using testing::HasSubstr;

Outcome run(const std::string &arguments) { return bole::test::runShell(BOLE_EXECUTABLE " " + arguments); }

struct ReproduceCommand : testing::Test
{
  std::string folder = testing::TempDir() + "bole_reproduce_" + std::to_string(getpid());
  ReproduceCommand() { fs::remove_all(folder); }
  ~ReproduceCommand() override { fs::remove_all(folder); }
  void simulate() const
  {
    ASSERT_EQ(run("simulate -o " + folder + "/short --seed 320 --samples 1 --frames 20 -q").status, 0);
  }
};

TEST_F(ReproduceCommand, PrintsTheStatisticsThatTheDetectorsThresholdsComeFrom)
{
  simulate();
  const Outcome outcome = run("reproduce --statistics " + folder + "/short");
  ASSERT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("mean gradient (Eq. 19), all lines"));
  EXPECT_THAT(outcome.text, HasSubstr("mean of 1 - p(background), near true trunks"));
}

TEST_F(ReproduceCommand, SaysWhatItMustBeGiven)
{
  const Outcome outcome = run("reproduce");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.text, HasSubstr("-o FOLDER or --statistics FLIGHT"));
}
} // namespace
