// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Every option once: its key, place, range, unit and effect. Reading, writing, checking and documenting go through it.

#include <bole/options.h>

#include <string>
#include <variant>
#include <vector>

namespace bole
{
/// An end of a range: a number, or what another option has now.
struct OptionBound
{
  double value = 0;
  const char *key = nullptr; ///< of that other option

  OptionBound(double number) : value(number) {} // NOLINT: a number is a bound
  OptionBound(const double &option, const char *name) : value(option), key(name) {}
};

struct OptionEntry
{
  const char *key; ///< "section.name"
  std::variant<double *, int *, bool *> value;
  OptionBound low, high; ///< both belong to the range; of numbers alone
  const char *unit;      ///< "" where there is none
  const char *effect;    ///< one line

  std::string section() const { return std::string(key).substr(0, std::string(key).find('.')); }
  std::string name() const { return std::string(key).substr(std::string(key).find('.') + 1); }
  std::string text() const;    ///< its value
  std::string allowed() const; ///< "a number in [0, 100]"
  std::string range() const;   ///< "0 to 100"; "true, false"
  bool isNumber() const { return value.index() < 2; }
  bool isInRange() const;                     ///< also false for NaN
  bool assign(const std::string &value_text); ///< false where \p value_text is not of its kind
};

/// Every option of \p options in the order of the sections. Points into \p options.
std::vector<OptionEntry> optionTable(Options &options);
} // namespace bole
