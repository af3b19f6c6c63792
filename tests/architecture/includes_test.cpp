// SPDX-License-Identifier: GPL-2.0-or-later
// The arrows between the stages: every #include <bole/...> must be on the list.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>

namespace
{
using Stages = std::set<std::string>;
const std::string kRoot = BOLE_SOURCE_DIR;

/// What each stage may include beside itself: the floors, no arrow runs back up.
const std::map<std::string, Stages> kAllowed = {
    {"geometry", {}},
    {"input", {"geometry"}},
    {"gradient", {"geometry"}},
    {"motion", {"geometry", "input"}},
    {"saliency", {"geometry"}},
    {"tracking", {"geometry", "gradient"}},
    {"summary", {"geometry"}},
    {"map", {"geometry"}},
    {"ardrone", {"geometry", "input"}},
    {"servo", {"geometry"}},
    {"simulation", {"geometry", "input"}},
    {"baseline", {"geometry", "input", "gradient", "tracking"}},
    {"detection", {"geometry", "gradient", "saliency"}},
    {"smoothing", {"geometry", "summary"}},
    {"output", {"geometry", "input", "map"}},
    {"pipeline",
     {"geometry", "input", "gradient", "motion", "saliency", "detection", "tracking", "summary", "smoothing", "map",
      "output"}},
    {"tasks", {"geometry", "input", "map", "tracking", "servo", "pipeline"}},
    {"trials", {"geometry", "input", "map", "tracking", "servo", "output", "pipeline", "simulation", "tasks"}}};

/// The stage of a header by its path below include/bole; a vp* header at the root belongs to its source's folder.
std::string stageOf(const std::string &path)
{
  const auto slash = path.find('/');
  if (slash != std::string::npos)
    return path.substr(0, slash);
  const std::string source = std::filesystem::path(path).stem().string() + ".cpp";
  for (const auto &[stage, allowed] : kAllowed)
    if (std::filesystem::exists(kRoot + "/src/" + stage + "/" + source))
      return stage;
  return "";
}

TEST(Architecture, StagesIncludeOnlyWhatTheyMay)
{
  const std::regex include("^\\s*#include <bole/([^>]+)>");
  int arrows = 0;
  for (const std::string root : {kRoot + "/include/bole", kRoot + "/src"})
    for (const auto &entry : std::filesystem::recursive_directory_iterator(root)) {
      if (entry.path().extension() != ".h" && entry.path().extension() != ".cpp")
        continue;
      const std::string relative = std::filesystem::relative(entry.path(), root).string();
      const std::string stage = stageOf(relative);
      ASSERT_TRUE(kAllowed.count(stage)) << relative << " is in no stage";
      std::ifstream file(entry.path());
      std::smatch match;
      for (std::string line; std::getline(file, line);) {
        if (!std::regex_search(line, match, include))
          continue;
        const std::string other = stageOf(match[1].str());
        ++arrows;
        EXPECT_TRUE(other == stage || kAllowed.at(stage).count(other))
            << relative << " includes " << match[1].str() << ": " << stage << " may not know " << other;
      }
    }
  EXPECT_GT(arrows, 100);
}
} // namespace
