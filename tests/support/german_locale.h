// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A program in a locale whose decimals have a comma, as a host with Qt or GTK may be.

#include <clocale>
#include <cstdlib>
#include <filesystem>
#include <locale>
#include <stdexcept>
#include <string>

namespace bole::test
{
/// Sets the locale of C and of C++ to German while it lives; the locale is made where the system has none.
class GermanLocale
{
public:
  GermanLocale()
  {
    std::string folder = (std::filesystem::temp_directory_path() / "bole-locale-XXXXXX").string();
    m_folder = mkdtemp(folder.data());
    const std::string make = "localedef -i de_DE -f UTF-8 --no-archive " + m_folder + "/de_DE.UTF-8 >/dev/null 2>&1";
    static_cast<void>(std::system(make.c_str()));
    setenv("LOCPATH", m_folder.c_str(), 1);
    try {
      std::locale::global(std::locale("de_DE.UTF-8")); // sets that of C, too
    }
    catch (const std::runtime_error &) {
    }
  }
  ~GermanLocale()
  {
    std::locale::global(std::locale::classic());
    unsetenv("LOCPATH");
    std::error_code error;
    std::filesystem::remove_all(m_folder, error);
  }
  GermanLocale(const GermanLocale &) = delete;
  GermanLocale &operator=(const GermanLocale &) = delete;

  /// Whether decimals have a comma now: false where the locale could not be made.
  static bool isOn() { return std::string(std::localeconv()->decimal_point) == ","; }

private:
  std::string m_folder;
};
} // namespace bole::test
