// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Reads the stages of a source tree and who includes whom. The lists of src/CMakeLists.txt are the only ones.

#include "support/files.h"

#include <algorithm>
#include <map>
#include <regex>
#include <set>
#include <sstream>

namespace bole::test
{
namespace fs = std::filesystem;
using Names = std::set<std::string>;

/// One bole_add_stage() of src/CMakeLists.txt.
struct Stage
{
  std::string name;
  Names depends;
  Names headers; ///< public headers without a source of their own
};

/// The stages in the order of the file.
inline std::vector<Stage> readStages(const fs::path &cmake_file)
{
  std::vector<Stage> stages;
  const std::regex call("\nbole_add_stage\\(([^)]*)\\)");
  const std::string text = textOf(cmake_file);
  for (std::sregex_iterator match(text.begin(), text.end(), call), end; match != end; ++match) {
    std::istringstream words((*match)[1].str());
    Stage stage;
    words >> stage.name;
    std::string keyword;
    for (std::string word; words >> word;) {
      if (word == "DEPENDS" || word == "HEADERS" || word == "FILES_A_UNIT")
        keyword = word;
      else if (keyword == "DEPENDS")
        stage.depends.insert(word);
      else if (keyword == "HEADERS")
        stage.headers.insert(word);
    }
    stages.push_back(stage);
  }
  return stages;
}

/// Who includes whom below \p root, which has the folders src and include/bole.
class IncludeGraph
{
public:
  explicit IncludeGraph(const fs::path &root) : m_root(root), m_stages(readStages(root / "src/CMakeLists.txt"))
  {
    for (const char *folder : {"include/bole", "src"})
      for (const auto &entry : fs::recursive_directory_iterator(root / folder))
        if (isSource(entry.path()))
          readFile(fs::relative(entry.path(), root).string());
  }

  /// What is wrong, a line each; empty for a sound tree.
  std::vector<std::string> faults() const
  {
    std::vector<std::string> faults = orderFaults();
    std::map<std::string, Names> seen; // by stage: the stages that its files see
    for (const auto &[file, included] : m_includes) {
      if (file.rfind("src/lab/", 0) == 0)
        continue;
      const std::string stage = stageOf(file);
      if (stage.empty()) {
        faults.push_back(file + " belongs to no stage: name it after HEADERS, or implement it in src/<stage>");
        continue;
      }
      for (const std::string &header : reachable(file)) {
        const std::string other = stageOf(header);
        if (other.empty() || other == stage)
          continue;
        if (seen[stage].insert(other).second && !stageNamed(stage).depends.count(other))
          faults.push_back(file + " sees " + header + ": " + stage + " may not know " + other);
      }
    }
    for (const Stage &stage : m_stages)
      for (const std::string &other : stage.depends)
        if (!seen[stage.name].count(other))
          faults.push_back(stage.name + " is allowed to know " + other + " and does not need to");
    return faults;
  }

  /// Includes of public headers that those who install bole cannot follow or should not have to.
  std::vector<std::string> publicFaults() const
  {
    std::vector<std::string> faults;
    const std::regex kept_private("\"(.*)\"|<(opencv2/|nlopt|yaml-cpp/|fmt/|nlohmann/|CLI/|embree|libav|libsw).*>");
    for (const auto &[file, lines] : m_lines)
      if (isPublic(file))
        for (const std::string &line : lines)
          if (std::regex_match(line, kept_private))
            faults.push_back(file + " includes " + line);
    return faults;
  }

  /// Includes of the laboratory's files, also by way of others, that are neither its own nor public: it is a program
  /// outside of bole, and shares with the command the headers of apps.
  std::vector<std::string> laboratoryFaults() const
  {
    std::vector<std::string> faults, open;
    for (const char *folder : {"src/lab", "apps/lab", "tests/lab"})
      if (fs::exists(m_root / folder))
        for (const auto &entry : fs::recursive_directory_iterator(m_root / folder))
          if (isSource(entry.path()))
            open.push_back(fs::relative(entry.path(), m_root).string());
    std::sort(open.begin(), open.end());
    Names seen(open.begin(), open.end());
    const std::regex include("^\\s*#\\s*include\\s*\"([^\"]+)\"");
    for (std::size_t i = 0; i < open.size(); ++i) {
      const std::string file = open[i];
      std::ifstream stream(m_root / file);
      std::smatch match;
      for (std::string line; std::getline(stream, line);) {
        if (!std::regex_search(line, match, include))
          continue;
        std::vector<fs::path> places = {fs::path(file).parent_path(), "src/lab"};
        places.emplace_back(file.rfind("tests/", 0) == 0 ? "tests" : "apps");
        const auto place = std::find_if(places.begin(), places.end(), [&](const fs::path &folder) {
          return fs::exists(m_root / folder / match[1].str());
        });
        if (place == places.end())
          faults.push_back(file + " includes \"" + match[1].str() + "\"");
        else if (const std::string found = (*place / match[1].str()).string(); seen.insert(found).second)
          open.push_back(found);
      }
    }
    return faults;
  }

  /// Files that include a header of ViSP and do not open the namespace that it may have.
  std::vector<std::string> namespaceFaults() const
  {
    const std::string opens = "include/bole/visp.h";
    std::vector<std::string> faults;
    for (const auto &[file, lines] : m_lines) {
      const auto of_visp = std::find_if(lines.begin(), lines.end(),
                                        [](const std::string &line) { return line.rfind("<visp3/", 0) == 0; });
      if (of_visp != lines.end() && file != opens && !reachable(file).count(opens))
        faults.push_back(file + " includes " + *of_visp + " without <bole/visp.h>");
    }
    return faults;
  }

  std::size_t publicHeaders() const
  {
    return static_cast<std::size_t>(
        std::count_if(m_lines.begin(), m_lines.end(), [](const auto &file) { return isPublic(file.first); }));
  }

private:
  static bool isSource(const fs::path &path) { return path.extension() == ".h" || path.extension() == ".cpp"; }
  static bool isPublic(const std::string &file) { return file.rfind("include/bole/", 0) == 0; }

  void readFile(const std::string &file)
  {
    const std::regex include("^\\s*#\\s*include\\s*([<\"][^>\"]+[>\"])");
    std::ifstream stream(m_root / file);
    std::smatch match;
    m_includes[file];
    m_lines[file];
    for (std::string line; std::getline(stream, line);)
      if (std::regex_search(line, match, include)) {
        m_lines[file].push_back(match[1].str());
        const std::string name = match[1].str().substr(1, match[1].length() - 2);
        const Names folders = match[1].str()[0] == '<' ? Names{"include/"} : Names{"src/", "src/lab/"};
        for (const std::string &folder : folders)
          if (fs::exists(m_root / (folder + name)))
            m_includes[file].insert(folder + name);
      }
  }

  /// The stage that \p file belongs to; empty for a public header that none implements.
  std::string stageOf(const std::string &file) const
  {
    const fs::path path(file);
    for (const Stage &stage : m_stages)
      if (isPublic(file)) {
        if (stage.headers.count(path.stem().string()) ||
            fs::exists(m_root / "src" / stage.name / (path.stem().string() + ".cpp")))
          return stage.name;
      }
      else if (path.parent_path() == fs::path("src") / stage.name)
        return stage.name;
    return "";
  }

  const Stage &stageNamed(const std::string &name) const
  {
    return *std::find_if(m_stages.begin(), m_stages.end(), [&](const Stage &stage) { return stage.name == name; });
  }

  /// Every file that \p file includes, also by way of others.
  Names reachable(const std::string &file) const
  {
    Names found;
    std::vector<std::string> open{file};
    while (!open.empty()) {
      const auto included = m_includes.find(open.back());
      open.pop_back();
      if (included != m_includes.end())
        for (const std::string &header : included->second)
          if (found.insert(header).second)
            open.push_back(header);
    }
    return found;
  }

  /// A stage may know only those above it in the list, so that there are no cycles.
  std::vector<std::string> orderFaults() const
  {
    std::vector<std::string> faults;
    Names earlier;
    for (const Stage &stage : m_stages) {
      for (const std::string &other : stage.depends)
        if (!earlier.count(other))
          faults.push_back(stage.name + " depends on " + other + ", which is no earlier stage");
      earlier.insert(stage.name);
    }
    return faults;
  }

  fs::path m_root;
  std::vector<Stage> m_stages;
  std::map<std::string, Names> m_includes;                 ///< files of the project, by path from the root
  std::map<std::string, std::vector<std::string>> m_lines; ///< as written, with <> or ""
};
} // namespace bole::test
