// SPDX-License-Identifier: GPL-2.0-or-later
// What somebody gets who installs bole: the README's program against the installed tree alone.
#include "support/shell.h"

#include <gmock/gmock.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace
{
namespace fs = std::filesystem;
using bole::test::Outcome;
using testing::HasSubstr;

std::string textOf(const fs::path &path)
{
  std::stringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

/// The C++ block of the README's section on programs.
std::string readmeProgram()
{
  const std::string readme = textOf(BOLE_SOURCE_DIR "/README.md");
  const std::string fence = "```cpp\n";
  const std::size_t section = readme.find("## Use it from a ViSP program");
  const std::size_t begin = readme.find(fence, section);
  const std::size_t end = readme.find("```", begin + fence.size());
  if (section == std::string::npos || begin == std::string::npos || end == std::string::npos)
    return "";
  return readme.substr(begin + fence.size(), end - begin - fence.size());
}

/// This build, installed once for all tests.
class Install : public testing::Test
{
protected:
  static void SetUpTestSuite()
  {
    std::string pattern = (fs::temp_directory_path() / "bole-install-XXXXXX").string();
    s_folder = mkdtemp(pattern.data());
    s_prefix = s_folder / "prefix";
    s_installed = bole::test::runShell(BOLE_CMAKE " --install " BOLE_BINARY_DIR " --prefix " + s_prefix.string());
  }
  static void TearDownTestSuite() { fs::remove_all(s_folder); }
  void SetUp() override { ASSERT_EQ(s_installed.status, 0) << s_installed.text; }

  inline static fs::path s_folder, s_prefix;
  inline static Outcome s_installed;
};
} // namespace

TEST_F(Install, TheProgramOfTheReadmeBuildsAndMapsTrunks)
{
  const fs::path outside = s_folder / "outside", build = s_folder / "build";
  fs::copy(BOLE_SOURCE_DIR "/tests/install/outside", outside);
  const std::string program = readmeProgram();
  ASSERT_THAT(program, HasSubstr("int main()"));
  std::ofstream(outside / "main.cpp") << program;

  std::string configure = BOLE_CMAKE " -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_COMPILER=" BOLE_COMPILER
                                     " -DCMAKE_PREFIX_PATH=" +
                          s_prefix.string() + " -S " + outside.string() + " -B " + build.string();
  const std::string sanitizers = BOLE_SANITIZERS;
  if (!sanitizers.empty())
    configure += " -DCMAKE_CXX_FLAGS=-fsanitize=" + sanitizers;
  const Outcome configured = bole::test::runShell(configure);
  ASSERT_EQ(configured.status, 0) << configured.text;
  EXPECT_THAT(configured.text, HasSubstr("data in " + (s_prefix / "share/bole").string()));
  const Outcome built = bole::test::runShell(BOLE_CMAKE " --build " + build.string());
  ASSERT_EQ(built.status, 0) << built.text;

  const char *display = std::getenv("DISPLAY");
  const bool has_display = display != nullptr && *display != '\0';
  if (!has_display && bole::test::runShell("command -v xvfb-run").status != 0)
    GTEST_SKIP() << "neither a display nor xvfb-run: the program was built and not run";
  const Outcome ran = bole::test::runShell("cd " + (s_prefix / "share/bole").string() + " && " +
                                           (has_display ? "" : "xvfb-run -a ") + (build / "outside").string());
  EXPECT_EQ(ran.status, 0) << ran.text;
  EXPECT_THAT(ran.text, HasSubstr(" m, radius "));
  EXPECT_TRUE(fs::exists(s_prefix / "share/bole/map.cao"));
}

TEST_F(Install, NothingOfTheSourceOrBuildTreeIsNeeded)
{
  for (const auto &entry : fs::recursive_directory_iterator(s_prefix))
    if (entry.path().extension() == ".cmake")
      EXPECT_THAT(textOf(entry.path()), testing::Not(HasSubstr(BOLE_SOURCE_DIR))) << entry.path();
}

TEST_F(Install, TheCommandFindsItsPresetsAndItsFlight)
{
  const fs::path share = s_prefix / "share/bole", folder = s_folder / "run";
  const Outcome ran = bole::test::runShell(
      (s_prefix / "bin/bole").string() + " track " + (share / "data/park-forward").string() + " -o " + folder.string() +
      " --config " + (share / "config/default.yaml").string() + " --no-video --frames 5");
  EXPECT_EQ(ran.status, 0) << ran.text;
  EXPECT_TRUE(fs::exists(folder / "trunks.csv"));
}
