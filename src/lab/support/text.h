// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What is said to a user: failures, names, figures; and files of text.

#include <bole/visp.h>
#include <fmt/format.h>
#include <visp3/core/vpException.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace bole
{
inline namespace lab
{
/// To be thrown: `throw badValue("{} = {}, must be above 0", name, value);`
template <typename... Arguments> vpException badValue(fmt::format_string<Arguments...> text, Arguments &&...arguments)
{
  return vpException(vpException::badValue, fmt::format(text, std::forward<Arguments>(arguments)...));
}
/// The same of a file or device.
template <typename... Arguments> vpException ioError(fmt::format_string<Arguments...> text, Arguments &&...arguments)
{
  return vpException(vpException::ioError, fmt::format(text, std::forward<Arguments>(arguments)...));
}

/// \throw vpException "name = value, must be in [low, high]", also where \p value is NaN.
inline void requireRange(const char *name, double value, double low, double high)
{
  if (!(value >= low && value <= high))
    throw badValue("{} = {:g}, must be in [{:g}, {:g}]", name, value, low, high);
}

/// Of a value beyond those of its enumeration.
constexpr const char *kUnknownName = "unknown";

/// The name of \p value; \p names stand in the order of the enumeration, which counts from 0.
template <typename Enum> const char *nameOf(Enum value, std::initializer_list<const char *> names)
{
  const auto at = static_cast<std::size_t>(value);
  return at < names.size() ? names.begin()[at] : kUnknownName;
}

/// All values of an enumeration by what toString() calls them.
template <typename Enum> std::vector<std::pair<std::string, Enum>> wordsOf(Enum)
{
  std::vector<std::pair<std::string, Enum>> words;
  for (Enum value{}; std::string(toString(value)) != kUnknownName; value = static_cast<Enum>(int(value) + 1))
    words.emplace_back(toString(value), value);
  return words;
}

/// The value that toString() calls \p word. \throw vpException naming \p option and its words, for another one.
template <typename Enum> Enum valueNamed(const char *option, const std::string &word)
{
  std::string wanted;
  const auto words = wordsOf(Enum());
  for (const auto &[name, value] : words) {
    if (name == word)
      return value;
    wanted += (wanted.empty() ? "" : name == words.back().first ? " or " : ", ") + name;
  }
  throw badValue("{} = {}, must be {}", option, word, wanted);
}

/// \p value with \p decimals, right-aligned in \p width columns; "-" where it was not measured (NaN).
inline std::string figure(double value, int width, int decimals)
{
  return std::isnan(value) ? fmt::format("{:>{}}", "-", width) : fmt::format("{:{}.{}f}", value, width, decimals);
}

/// \p text as one field of a table, quoted where it must be (RFC 4180).
inline std::string csvField(std::string text)
{
  if (text.find_first_of(",\"\r\n") == std::string::npos)
    return text;
  for (std::size_t i = text.find('"'); i != std::string::npos; i = text.find('"', i + 2))
    text.insert(i, 1, '"');
  return '"' + text + '"';
}

/// \p text becomes the file \p path, whole or not at all.
inline void writeFile(const std::string &path, std::string_view text)
{
  const std::string beside = path + ".part";
  std::ofstream file(beside, std::ios::binary);
  file << text;
  file.close();
  if (!file || std::rename(beside.c_str(), path.c_str()) != 0)
    throw ioError("{}: cannot be written", path);
}
} // namespace lab
} // namespace bole
