// SPDX-License-Identifier: GPL-2.0-or-later
// `bole graph` and `bole solve` as their users run them: on a real run, and on files gone bad.
#include "run_bole.h"

#include <gmock/gmock.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <regex>
#include <string>
#include <unistd.h>
#include <vector>

namespace
{
namespace fs = std::filesystem;
using namespace bole::test;
using testing::HasSubstr;

std::vector<std::string> linesOf(const std::string &path)
{
  std::vector<std::string> lines;
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);)
    lines.push_back(line);
  return lines;
}

/// The number after the last "cost".
double lastCost(const std::string &text)
{
  const std::regex number("cost +([-0-9.e+]+)");
  double value = -1;
  for (std::sregex_iterator at(text.begin(), text.end(), number), end; at != end; ++at)
    value = std::stod((*at)[1]);
  return value;
}

/// A run of the first frames of the demonstration flight, made once a process.
struct GraphCommand : testing::Test
{
  static std::string folder, file;
  static void SetUpTestSuite()
  {
    folder = testing::TempDir() + "bole_graph_run_" + std::to_string(getpid());
    fs::remove_all(folder);
    ASSERT_EQ(run("track " + kFlight + " -o " + folder + " --no-video --frames 40").status, 0);
    file = folder + "/exported.g2o";
    const Outcome exported = run("export " + folder + " g2o -o " + file);
    ASSERT_EQ(exported.status, 0) << exported.text;
    ASSERT_THAT(run("graph " + folder).text, HasSubstr("poses      40"));
  }
  static void TearDownTestSuite() { fs::remove_all(folder); }
  /// The exported graph with its first line of \p tag changed by \p edit, and the place of that
  /// line.
  template <typename Edit> std::pair<std::string, std::string> broken(const std::string &tag, const Edit &edit)
  {
    std::vector<std::string> lines = linesOf(file);
    const std::string path = folder + "/broken.g2o";
    std::ofstream out(path);
    std::size_t place = 0;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (place == 0 && lines[i].rfind(tag + " ", 0) == 0) {
        place = i + 1;
        lines[i] = edit(lines[i]);
      }
      out << lines[i] << "\n";
    }
    return {path, path + ":" + std::to_string(place) + ": "};
  }
  static void expectRefused(const std::pair<std::string, std::string> &file_and_place, const std::string &says)
  {
    const Outcome outcome = run("solve " + file_and_place.first + " -o " + folder + "/none.g2o");
    EXPECT_NE(outcome.status, 0);
    EXPECT_THAT(outcome.text, HasSubstr(file_and_place.second));
    EXPECT_THAT(outcome.text, HasSubstr(says));
    EXPECT_FALSE(fs::exists(folder + "/none.g2o"));
  }
};
std::string GraphCommand::folder, GraphCommand::file;

TEST_F(GraphCommand, ExportsAGraphThatSolvesToTheCostOfTheRun)
{
  const double of_run = lastCost(run("graph " + folder).text);
  const Outcome solved = run("solve " + file + " -o " + folder + "/solved.g2o");

  EXPECT_EQ(solved.status, 0) << solved.text;
  EXPECT_GT(of_run, 0);
  EXPECT_NEAR(lastCost(solved.text), of_run, 1e-4 * of_run); // the run ends at its optimum
  EXPECT_EQ(linesOf(folder + "/solved.g2o").size(), linesOf(file).size());
}

TEST_F(GraphCommand, NamesTheLineOfNaN)
{
  expectRefused(broken("VERTEX_SE3:QUAT", [](const std::string &) { return "VERTEX_SE3:QUAT 0 nan 0 0 0 0 0 1"; }),
                "must be a finite number");
}

TEST_F(GraphCommand, NamesTheLineOfAnUnknownTag)
{
  expectRefused(broken("VERTEX_SE3:QUAT", [](const std::string &) { return "VERTEX_CAR 0 1 2"; }), "tag = VERTEX_CAR");
}

TEST_F(GraphCommand, NamesTheLineOfAnIdUsedTwice)
{
  expectRefused(broken("VERTEX_TRUNK",
                       [](const std::string &line) {
                         return std::regex_replace(line, std::regex("VERTEX_TRUNK [0-9]+"), "VERTEX_TRUNK 3");
                       }),
                "must not be that of line");
}

TEST_F(GraphCommand, NamesTheLineOfAnIndefiniteSummary)
{
  expectRefused(
      broken("EDGE_TRUNK_SUMMARY", [](const std::string &line) { return line.substr(0, line.rfind(' ')) + " -1e9"; }),
      "F, must be positive semi-definite");
}

TEST_F(GraphCommand, NamesTheLineOfAPoseThatNothingTies)
{
  const auto [path, place] = broken("VERTEX_SE3:QUAT", [](const std::string &line) { return line; });
  std::ofstream(path, std::ios::app) << "VERTEX_SE3:QUAT 123456 0 0 0 0 0 0 1\n";
  expectRefused({path, path + ":" + std::to_string(linesOf(path).size()) + ": "},
                "pose 123456, must be tied to the world");
}
} // namespace
