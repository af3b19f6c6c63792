// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What needs ViSP's trackers, robots and windows, or the laboratory, stands in a module that is loaded when it is
/// asked for: it brings more libraries than all the rest.

#include <bole/visp.h>
#include <dlfcn.h>
#include <string>
#include <visp3/core/vpException.h>

namespace bole::apps
{
/// A function of the module; throws vpException where there is none.
template <typename Function> Function *fromModule(const char *name)
{
  void *const module = dlopen("bole_commands.so", RTLD_NOW);
  void *const found = module == nullptr ? nullptr : dlsym(module, name);
  if (found == nullptr)
    throw vpException(vpException::fatalError, std::string(dlerror()));
  return reinterpret_cast<Function *>(found);
}
} // namespace bole::apps
