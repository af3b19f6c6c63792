// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Modules of the command, loaded when they are asked for, as they bring more libraries than all the rest:
/// bole_commands.so, what needs ViSP's trackers, robots and windows; bole_lab.so, the laboratory, where it was built.
/// Each adds its subcommands by boleAddCommands(CLI::App &).

#include <bole/visp.h>
#include <dlfcn.h>
#include <string>
#include <visp3/core/vpException.h>

namespace bole::apps
{
/// A function of a module; throws vpException where there is none.
template <typename Function> Function *fromModule(const char *module, const char *name)
{
  void *const loaded = dlopen(module, RTLD_NOW);
  void *const found = loaded == nullptr ? nullptr : dlsym(loaded, name);
  if (found == nullptr)
    throw vpException(vpException::fatalError, std::string(dlerror()));
  return reinterpret_cast<Function *>(found);
}
} // namespace bole::apps
