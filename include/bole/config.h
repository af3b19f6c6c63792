// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Options from YAML files and from the command line: strict, with the place of every mistake.
///
/// A file has one map a section whose keys are those of `bole options`. Keys that are not given keep their value.
/// Unknown, repeated, mistyped and out-of-range keys are errors.
///
/// Laws (each a test): config/default.yaml is toYaml(Options()); reading toYaml(x) gives x.

#include <bole/options.h>

#include <string>
#include <vector>

namespace bole
{
/// Reads \p path over \p options.
/// \throw vpException "file:line: key = value, must be ..."; \p options is then unchanged.
void readConfig(const std::string &path, Options &options);

/// Sets options from assignments "section.name=value", each option at most once.
/// \param assignments each "section.name=value"
/// \param options what they are set in
/// \param said_as what a message writes before an assignment
/// \throw vpException "--set assignment: ..."; \p options is then unchanged.
void setOptions(const std::vector<std::string> &assignments, Options &options, const std::string &said_as = "--set ");

/// All options as YAML, with what they do.
std::string toYaml(const Options &options);

/// What one option is, for people.
struct OptionDescription
{
  std::string key;    ///< as `bole options` prints them
  std::string unit;   ///< as `bole options` prints them
  std::string range;  ///< as `bole options` prints them
  std::string value;  ///< as `bole options` prints them
  std::string effect; ///< as `bole options` prints them
};
/// Every option with its value in \p options, in the order of the sections.
std::vector<OptionDescription> describeOptions(const Options &options = {});
} // namespace bole
