// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Options from YAML files: strict, with the line of every mistake.
///
/// A file has one map a stage (`flow`, `motion`, `points`, `gyro`, `relative_pose`, `gradient`, `saliency`,
/// `detection`, `energy`, `tracking`, `smoothing`, `map`) whose keys are the names of the members of that stage's
/// options. Keys that are not given keep their value. Unknown, repeated, mistyped and out-of-range keys are errors.
///
/// Laws (each a test): config/default.yaml gives the defaults of the code; readConfig(toYaml(x)) == x.

#include "pipeline/stage_options.h"

#include <string>
#include <variant>
#include <vector>

namespace bole
{
/// One option by name ("stage.name") with the place of its value.
struct OptionEntry
{
  std::string name;
  std::variant<double *, int *, bool *, std::vector<int> *, EnergyForm *, LossKind *> value;
};

/// Every option of \p options, in the order of the stages. Points into \p options.
std::vector<OptionEntry> optionEntries(StageOptions &options);

/// Reads \p path over \p options and validates the result.
/// \throw vpException "file:line: key = value, must be ..."; \p options is then unchanged.
void readConfig(const std::string &path, StageOptions &options);

/// Sets one option from "stage.name=value". \throw vpException naming it.
void setOption(const std::string &assignment, StageOptions &options);

/// All options as YAML.
std::string toYaml(const StageOptions &options);
} // namespace bole
