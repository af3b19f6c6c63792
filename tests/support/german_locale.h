// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A program in a locale whose decimals have a comma, as a host with Qt or GTK may be.

#include "support/files.h"

#include <clocale>
#include <locale>

namespace bole::test
{
/// Sets the locale of C and of C++ to German while it lives; the locale is made where the system has none.
class GermanLocale
{
public:
  GermanLocale()
  {
    const std::string make =
        "localedef -i de_DE -f UTF-8 --no-archive " + m_folder.path() + "/de_DE.UTF-8 >/dev/null 2>&1";
    static_cast<void>(std::system(make.c_str()));
    setenv("LOCPATH", m_folder.path().c_str(), 1);
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
  }
  GermanLocale(const GermanLocale &) = delete;
  GermanLocale &operator=(const GermanLocale &) = delete;

  /// Whether decimals have a comma now: false where the locale could not be made.
  static bool isOn() { return std::string(std::localeconv()->decimal_point) == ","; }

private:
  TemporaryFolder m_folder;
};
} // namespace bole::test
