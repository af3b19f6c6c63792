// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/config.h>

#include "input/user_text.h"
#include "input/yaml_file.h"
#include "pipeline/option_table.h"

#include <algorithm>
#include <bole/visp.h>
#include <fmt/format.h>
#include <set>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
[[noreturn]] void fail(const std::string &message) { throw vpException(vpException::badValue, "%s", message.c_str()); }

/// "; did you mean ...?" with the nearest of \p names, or where to look where none is near.
std::string suggestion(const std::string &wrong, const std::set<std::string> &names)
{
  const std::string nearest = nearestWord(wrong, {names.begin(), names.end()});
  return nearest.empty() ? "; bole options lists them" : fmt::format("; did you mean {}?", nearest);
}

/// The key meant by \p wrong: one that is written alike, or one of that name in another section.
std::string suggestKey(const std::string &wrong, const std::vector<OptionEntry> &entries)
{
  std::set<std::string> keys;
  for (const OptionEntry &entry : entries) {
    if (entry.name() == wrong.substr(wrong.find('.') + 1))
      return fmt::format("; did you mean {}?", entry.key);
    keys.insert(entry.key);
  }
  return suggestion(wrong, keys);
}

/// A value that somebody gave, with its place for messages.
struct Given
{
  std::string place, key, value;
};

/// All that was given, or nothing. Ranges that depend on other options are those when all is set.
void assign(const std::vector<Given> &all, Options &options)
{
  Options changed = options;
  const auto find = [](std::vector<OptionEntry> &entries, const std::string &key) {
    return std::find_if(entries.begin(), entries.end(), [&](const OptionEntry &e) { return e.key == key; });
  };
  std::vector<OptionEntry> entries = optionTable(changed);
  std::set<std::string> seen;
  for (const Given &given : all) {
    const auto entry = find(entries, given.key);
    if (entry == entries.end())
      fail(fmt::format("{}: {} is no option{}", given.place, given.key, suggestKey(given.key, entries)));
    if (!seen.insert(given.key).second)
      fail(fmt::format("{}: {} is given twice", given.place, given.key));
    if (!entry->assign(given.value))
      fail(fmt::format("{}: {} = {}, must be {}", given.place, given.key, given.value, entry->allowed()));
  }
  entries = optionTable(changed);
  for (const Given &given : all)
    if (const auto entry = find(entries, given.key); !entry->isInRange())
      fail(fmt::format("{}: {} = {}, must be {}", given.place, given.key, given.value, entry->allowed()));
  changed.validate();
  options = changed;
}

std::string shownValue(const YAML::Node &node)
{
  if (node.IsScalar())
    return node.Scalar().substr(0, 80);
  return node.IsNull() ? "(nothing)" : node.IsMap() ? "(a map)" : "(a list)";
}
} // namespace

void Options::validate() const
{
  Options copy = *this;
  for (const OptionEntry &entry : optionTable(copy))
    if (!entry.isInRange())
      fail(fmt::format("{} = {}, must be {}", entry.key, entry.text(), entry.allowed()));
}

void readConfig(const std::string &path, Options &options)
{
  const YAML::Node root = loadYaml(path);
  if (!root.IsNull() && !root.IsMap())
    fail(fmt::format("{}: must be a map of sections", placeOf(path, root.Mark())));
  Options none;
  std::set<std::string> sections, seen;
  for (const OptionEntry &entry : optionTable(none))
    sections.insert(entry.section());
  std::vector<Given> all;
  for (const auto &section : root) {
    const std::string name = section.first.Scalar(), place = placeOf(path, section.first.Mark());
    if (sections.count(name) == 0)
      fail(fmt::format("{}: {} is no section{}", place, name, suggestion(name, sections)));
    if (!seen.insert(name).second)
      fail(fmt::format("{}: {} is given twice", place, name));
    if (!section.second.IsMap())
      fail(fmt::format("{}: {} = {}, must be a map of options", place, name, shownValue(section.second)));
    for (const auto &pair : section.second)
      all.push_back({placeOf(path, pair.first.Mark()), name + "." + pair.first.Scalar(), shownValue(pair.second)});
  }
  assign(all, options);
}

void setOptions(const std::vector<std::string> &assignments, Options &options, const std::string &said_as)
{
  std::vector<Given> all;
  for (const std::string &assignment : assignments) {
    const auto equals = assignment.find('=');
    if (equals == std::string::npos)
      fail(fmt::format("{}{}: must be section.name=value", said_as, assignment));
    all.push_back({said_as + assignment, assignment.substr(0, equals), assignment.substr(equals + 1)});
  }
  assign(all, options);
}

std::vector<OptionDescription> describeOptions(const Options &options)
{
  Options copy = options;
  std::vector<OptionDescription> all;
  for (const OptionEntry &entry : optionTable(copy))
    all.push_back({entry.key, entry.unit, entry.range(), entry.text(), entry.effect});
  return all;
}

std::string toYaml(const Options &options)
{
  Options copy = options;
  std::string text, section;
  for (const OptionEntry &entry : optionTable(copy)) {
    if (entry.section() != section)
      text += (section = entry.section()) + ":\n";
    const std::string unit = *entry.unit != '\0' ? fmt::format("[{}] ", entry.unit) : "";
    text += fmt::format("  {:<28} # {}{}\n", entry.name() + ": " + entry.text(), unit, entry.effect);
  }
  return text;
}
} // namespace bole
