// SPDX-License-Identifier: GPL-2.0-or-later
// What somebody gets who installs bole: the README's program against the installed tree alone.
#include "support/files.h"
#include "support/shell.h"

#include <gmock/gmock.h>

#include <algorithm>

namespace
{
namespace fs = std::filesystem;
using bole::test::Outcome;
using bole::test::textOf;
using testing::HasSubstr;

/// The block in \p language of the README's section on programs.
std::string readmeBlock(const std::string &language)
{
  const std::string readme = textOf(BOLE_SOURCE_DIR "/README.md");
  const std::string fence = "```" + language + "\n";
  const std::size_t section = readme.find("## Use it from a ViSP program");
  const std::size_t begin = readme.find(fence, section);
  const std::size_t end = readme.find("```", begin + fence.size());
  if (section == std::string::npos || begin == std::string::npos || end == std::string::npos)
    return "";
  return readme.substr(begin + fence.size(), end - begin - fence.size());
}

/// Opens a flight and uses Eigen, ViSP and the library.
constexpr const char *kProgram = "#include <bole/open_source.h>\n"
                                 "int main(int count, char **arguments)\n"
                                 "{\n"
                                 "  return count > 1 && bole::openSource(arguments[1])->camera().width > 0 ? 0 : 1;\n"
                                 "}\n";

/// The images of the demonstration flight as flight0000.png and so on: ViSP's reader takes no names of 13 digits.
void numberTheDemonstrationFlight(const fs::path &folder)
{
  fs::create_directories(folder);
  std::vector<fs::path> images;
  for (const auto &entry : fs::directory_iterator(BOLE_SOURCE_DIR "/data/park-forward/mav0/cam0/data"))
    images.push_back(entry.path());
  std::sort(images.begin(), images.end());
  for (std::size_t i = 0; i < images.size(); ++i) {
    std::string number = std::to_string(i);
    number.insert(0, 4 - number.size(), '0');
    fs::create_symlink(images[i], folder / ("flight" + number + ".png"));
  }
}

/// This build, installed once for all tests.
class Install : public testing::Test
{
protected:
  static void SetUpTestSuite()
  {
    s_temporary = std::make_unique<bole::test::TemporaryFolder>();
    s_folder = s_temporary->path();
    s_prefix = s_folder / "prefix";
    s_installed =
        bole::test::runShell("umask 077; " BOLE_CMAKE " --install " BOLE_BINARY_DIR " --prefix " + s_prefix.string());
  }
  static void TearDownTestSuite() { s_temporary.reset(); }
  void SetUp() override { ASSERT_EQ(s_installed.status, 0) << s_installed.text; }

  /// The build folder of a program of somebody else's with \p program as its source, configured with \p arguments.
  fs::path configure(const std::string &name, const std::string &program, const std::string &arguments,
                     const std::string &lists = "")
  {
    const fs::path outside = s_folder / name, build = outside / "build";
    fs::copy(BOLE_SOURCE_DIR "/tests/install/outside", outside);
    if (!lists.empty())
      std::ofstream(outside / "CMakeLists.txt") << lists;
    std::ofstream(outside / "main.cpp") << program;
    std::string command = BOLE_CMAKE " -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_COMPILER=" BOLE_COMPILER " " +
                          arguments + " -S " + outside.string() + " -B " + build.string();
    if (*BOLE_SANITIZERS != '\0')
      command += " -DCMAKE_CXX_FLAGS=-fsanitize=" BOLE_SANITIZERS;
    const Outcome configured = bole::test::runShell(command);
    m_configured = configured.text;
    EXPECT_EQ(configured.status, 0) << m_configured;
    return build;
  }

  std::string m_configured; ///< what CMake printed
  inline static std::unique_ptr<bole::test::TemporaryFolder> s_temporary;
  inline static fs::path s_folder, s_prefix;
  inline static Outcome s_installed;
};
} // namespace

TEST_F(Install, TheProgramOfTheReadmeBuildsAndMapsTrunks)
{
  const std::string program = readmeBlock("cpp"), lists = readmeBlock("cmake");
  ASSERT_THAT(program, HasSubstr("int main("));
  ASSERT_THAT(lists, HasSubstr("find_package(bole"));
  const fs::path build = configure("readme", program, "-DCMAKE_PREFIX_PATH=" + s_prefix.string(), lists);
  const Outcome built = bole::test::runShell(BOLE_CMAKE " --build " + build.string());
  ASSERT_EQ(built.status, 0) << built.text;

  const char *display = std::getenv("DISPLAY");
  const bool has_display = display != nullptr && *display != '\0';
  if (!has_display && bole::test::runShell("command -v xvfb-run").status != 0)
    GTEST_SKIP() << "neither a display nor xvfb-run: the program was built and not run";
  const fs::path flight = s_folder / "flight";
  numberTheDemonstrationFlight(flight);
  const Outcome ran = bole::test::runShell("cd " + flight.string() + " && " + (has_display ? "" : "xvfb-run -a ") +
                                           (build / "trunks").string());
  EXPECT_EQ(ran.status, 0) << ran.text;
  EXPECT_THAT(ran.text, HasSubstr(" m, radius "));
  EXPECT_TRUE(fs::exists(flight / "map.cao"));
}

TEST_F(Install, ABuildTreeIsFoundAsAnInstallationIs)
{
  const fs::path build = configure("build_tree", kProgram, "-Dbole_DIR=" BOLE_BINARY_DIR);
  EXPECT_THAT(m_configured, HasSubstr("data in " BOLE_SOURCE_DIR));
  const Outcome built = bole::test::runShell(BOLE_CMAKE " --build " + build.string() + " && " + build.string() +
                                             "/outside " BOLE_SOURCE_DIR "/data/park-forward");
  EXPECT_EQ(built.status, 0) << built.text;
}

// The library itself is not built a second time: the program is compiled, and the link is CMake's to arrange.
TEST_F(Install, TheSourcesAreAPartOfAnotherProject)
{
  const fs::path build = configure("subdirectory", kProgram, "-DBOLE_SOURCES=" BOLE_SOURCE_DIR);
  const Outcome built =
      bole::test::runShell(BOLE_CMAKE " --build " + build.string() + " --target CMakeFiles/outside.dir/main.cpp.o");
  EXPECT_EQ(built.status, 0) << built.text;
}

TEST_F(Install, NothingOfTheSourceOrBuildTreeIsNeeded)
{
  for (const auto &entry : fs::recursive_directory_iterator(s_prefix))
    if (entry.path().extension() == ".cmake") {
      EXPECT_THAT(textOf(entry.path()), testing::Not(HasSubstr(BOLE_SOURCE_DIR))) << entry.path();
    }
}

TEST_F(Install, EverybodyMayReadItWhateverTheUmaskOfWhoInstalled)
{
  for (const auto &entry : fs::recursive_directory_iterator(s_prefix)) {
    const auto others = entry.is_directory() ? fs::perms::others_read | fs::perms::others_exec : fs::perms::others_read;
    EXPECT_EQ(entry.status().permissions() & others, others) << entry.path();
  }
}

TEST_F(Install, EveryPackageHasItsCopyright)
{
  for (const char *package : {"bole", "libbole0.1", "libbole-dev"})
    EXPECT_THAT(textOf(s_prefix / "share/doc" / package / "copyright"), HasSubstr("License: GPL-2.0-or-later"))
        << package;
}

TEST_F(Install, DebiansPythonFindsTheModuleBelowUsrLocal)
{
  if (!fs::exists(BOLE_BINARY_DIR "/python") || *BOLE_SANITIZERS != '\0')
    GTEST_SKIP() << "no Python module was built (pybind11-dev), or one with sanitizers";
  const Outcome ran = bole::test::runShell(
      "/usr/bin/python3 -c 'import site, sys; sys.path[:0] = [p.replace(\"/usr/local\", \"" + s_prefix.string() +
      "\") for p in site.getsitepackages() if p.startswith(\"/usr/local\")]; import bole; print(bole.__file__)'");
  EXPECT_EQ(ran.status, 0) << ran.text;
  EXPECT_THAT(ran.text, HasSubstr(s_prefix.string()));
}

TEST_F(Install, TheCommandFindsItsPresetsAndItsFlightByName)
{
  const fs::path folder = s_folder / "run";
  const Outcome ran =
      bole::test::runShell("cd / && " + (s_prefix / "bin/bole").string() + " track park-forward --config default -o " +
                           folder.string() + " --no-video --frames 15");
  EXPECT_EQ(ran.status, 0) << ran.text;
  EXPECT_TRUE(fs::exists(folder / "trunks.csv"));
}

TEST_F(Install, TheCommandFindsTheCommandsOfItsModule)
{
  const Outcome ran = bole::test::runShell("cd / && " + (s_prefix / "bin/bole").string() + " follow --help");
  EXPECT_EQ(ran.status, 0) << ran.text;
  EXPECT_THAT(ran.text, HasSubstr("--model"));
}

TEST_F(Install, TheCommandTellsItsVersions)
{
  const Outcome ran = bole::test::runShell((s_prefix / "bin/bole").string() + " --version");
  EXPECT_THAT(ran.text,
              testing::MatchesRegex("bole [0-9.]+( \\([0-9a-f]+(-dirty)?\\))?, ViSP [0-9.]+, OpenCV [0-9.]+.*\n"));
}

TEST_F(Install, EveryCommandHasAManPageAndIsCompleted)
{
  const std::string page = textOf(s_prefix / "share/man/man1/bole-track.1");
  EXPECT_THAT(page, HasSubstr(".SH NAME\nbole\\-track \\- Map the trunks"));
  EXPECT_THAT(page, HasSubstr("\\-\\-config VALUE"));
  EXPECT_THAT(textOf(s_prefix / "share/man/man1/bole.1"), HasSubstr("bole\\-evaluate(1)"));

  const Outcome completed =
      bole::test::runShell("bash -c '. " + (s_prefix / "share/bash-completion/completions/bole").string() +
                           "; COMP_WORDS=(bole track --conf); COMP_CWORD=2; _bole; echo ${COMPREPLY[@]}; "
                           "COMP_WORDS=(bole ev); COMP_CWORD=1; "
                           "_bole; echo ${COMPREPLY[@]}'");
  EXPECT_EQ(completed.text, "--config\nevaluate\n");
  EXPECT_THAT(textOf(s_prefix / "share/zsh/site-functions/_bole"), HasSubstr("'--config["));
}
