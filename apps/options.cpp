// SPDX-License-Identifier: GPL-2.0-or-later
// bole options: every option with its unit, range, default and effect.
#include "commands.h"

#include <bole/config.h>

#include <fmt/format.h>
#include <memory>

namespace bole::apps
{
namespace
{
std::string afterValue(const std::string &unit) { return unit.empty() ? "" : " " + unit; }

void printMarkdown()
{
  fmt::print("| option | range | default | effect |\n|---|---|---|---|\n");
  for (const OptionDescription &option : describeOptions())
    fmt::print("| `{}` | {} | {}{} | {} |\n", option.key, option.range, option.value, afterValue(option.unit),
               option.effect);
}

void printTable()
{
  std::string section;
  for (const OptionDescription &option : describeOptions()) {
    const std::string its = option.key.substr(0, option.key.find('.'));
    if (its != section && !section.empty())
      fmt::print("\n");
    section = its;
    fmt::print("{:<26} {:<8} {}; {}{}\n", option.key, option.value, option.effect, option.range,
               afterValue(option.unit));
  }
}
} // namespace

void addOptions(CLI::App &app)
{
  CLI::App *command = app.add_subcommand("options", "The options of the pipeline: default, effect, range and unit");
  const auto is_markdown = std::make_shared<bool>(false);
  command->add_flag("--markdown", *is_markdown, "As a table for documentation");
  const auto is_yaml = std::make_shared<bool>(false);
  command->add_flag("--yaml", *is_yaml, "As a file to start from");
  command->footer("Give them as --set KEY=VALUE or in a file: bole track flight -o run --config my.yaml\n"
                  "Presets: config/*.yaml");
  command->callback([is_markdown, is_yaml] {
    if (*is_yaml)
      fmt::print("{}", toYaml(Options()));
    else
      *is_markdown ? printMarkdown() : printTable();
  });
}
} // namespace bole::apps
