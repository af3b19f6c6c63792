// SPDX-License-Identifier: GPL-2.0-or-later
// The command `bole`: one subcommand a file, see commands.h.
#include "command_module.h"
#include "commands.h"

#include "input/user_text.h"
#include "output/summary_json.h"

#include <algorithm>
#include <cstdio>
#include <functional>
#include <pthread.h>
#include <string>
#include <sys/resource.h>
#include <thread>

namespace
{
using namespace bole::apps;

/// "bole 0.1.0 (9720183abc), ViSP 3.5.0, OpenCV 4.6.0"
std::string versionLine()
{
  const auto of = bole::versions();
  return "bole " + of.at("bole") + " (" + of.at("commit") + "), ViSP " + of.at("visp") + ", OpenCV " + of.at("opencv");
}

void addCommands(CLI::App &app)
{
  addTrack(app);
  addEvaluate(app);
  addReport(app);
  addExport(app);
  addOptions(app);
  addLocalise(app);
  addRecord(app);
  addGraph(app);
  addSolve(app);
}

/// Those of the modules, and the documentation of all.
void addMoreCommands(CLI::App &app)
{
  fromModule<void(CLI::App &)>("bole_commands.so", "boleAddCommands")(app);
#ifdef BOLE_LAB
  fromModule<void(CLI::App &)>("bole_lab.so", "boleAddCommands")(app);
#endif
  addDocumentation(app, "bole " BOLE_VERSION);
}

/// The innermost command that was named.
const CLI::App &commandOf(const CLI::App &app)
{
  const auto named = app.get_subcommands();
  return named.empty() ? app : commandOf(*named.front());
}

std::vector<std::string> commandsOf(const CLI::App &app)
{
  std::vector<std::string> names;
  for (const CLI::App *command : app.get_subcommands([](const CLI::App *) { return true; }))
    names.push_back(command->get_name());
  return names;
}

std::vector<std::string> optionsOf(const CLI::App &command)
{
  std::vector<std::string> names;
  for (const CLI::Option *option : command.get_options())
    for (const std::string &name : option->get_lnames())
      names.push_back("--" + name);
  return names;
}

/// \p text on one line, without passwords and without what a terminal would obey: it may come from a file.
std::string shown(const std::string &text)
{
  std::string line = bole::withoutSecrets(text);
  for (char &c : line)
    if (static_cast<unsigned char>(c) < ' ' || c == '\x7F')
      c = c == '\n' || c == '\t' ? ' ' : '?';
  return line;
}

void sayUnknown(const std::string &word, const char *kind, const std::vector<std::string> &known)
{
  const std::string name = shown(word).substr(0, word.find('=')), meant = bole::nearestWord(name, known);
  std::fprintf(stderr, "bole: %s: no such %s%s\n", name.c_str(), kind,
               meant.empty() ? "" : (", did you mean " + meant + "?").c_str());
}

/// Says what is wrong with the command line, with the name that may have been meant.
int refuse(const CLI::App &app, const CLI::ParseError &error)
{
  const CLI::App &command = commandOf(app);
  const std::vector<std::string> unknown = app.remaining(true), subcommands = commandsOf(command);
  const auto option =
      std::find_if(unknown.begin(), unknown.end(), [](const std::string &word) { return word[0] == '-'; });
  if (!subcommands.empty() && !unknown.empty() && unknown.front()[0] != '-')
    sayUnknown(unknown.front(), "command", subcommands);
  else if (option != unknown.end())
    sayUnknown(*option, "option", optionsOf(command));
  else
    std::fprintf(stderr, "bole: %s\n", shown(error.what()).c_str());
  std::fprintf(stderr, "Try `%s --help`.\n", &command == &app ? "bole" : ("bole " + command.get_name()).c_str());
  return static_cast<int>(ExitCode::usage);
}

/// Whether the first argument is answered by the commands of \p app.
bool isEnough(const CLI::App &app, int argc, char **argv)
{
  const std::vector<std::string> known = commandsOf(app);
  const std::string first = argc > 1 ? argv[1] : "";
  return first == "--version" || std::find(known.begin(), known.end(), first) != known.end();
}

int run(CLI::App &app, int argc, char **argv)
{
  try {
    addCommands(app);
    if (!isEnough(app, argc, argv))
      addMoreCommands(app);
    if (argc == 1) {
      std::fputs(app.help().c_str(), stdout);
      return static_cast<int>(ExitCode::good);
    }
    app.parse(argc, argv);
  }
  catch (const CLI::RuntimeError &end) {
    return end.get_exit_code();
  }
  catch (const CLI::ParseError &error) {
    return error.get_exit_code() == 0 ? app.exit(error) : refuse(app, error);
  }
  catch (const std::exception &error) { // vpException too
    std::fprintf(stderr, "bole: %s\n", shown(error.what()).c_str());
    return static_cast<int>(ExitCode::error);
  }
  return static_cast<int>(ExitCode::good);
}

/// Calls \p work with stacks of 8 MB for it and for every thread, however little `ulimit -s` leaves.
int withRoom(const std::function<int()> &work)
{
  constexpr std::size_t kStack = std::size_t{8} << 20; // bytes
  rlimit limit = {};
  if (getrlimit(RLIMIT_STACK, &limit) != 0 || limit.rlim_cur >= kStack)
    return work();
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, kStack);
  pthread_setattr_default_np(&attributes);
  pthread_attr_destroy(&attributes);
  int status = 0;
  std::thread([&] { status = work(); }).join();
  return status;
}
int start(int argc, char **argv)
{
  CLI::App app("bole: tree trunks as vertical cylinders, tracked and mapped from a small drone's video", "bole");
  app.set_version_flag("--version", versionLine());
  app.require_subcommand(1);
  app.footer("`bole COMMAND --help` tells the options of a command, with examples.\n"
             "Exit status: 0 good; 1 error; 2 unknown command or option; 3 done, but the result is not to be trusted;\n"
             "130 interrupted, what was known is kept.");
  return run(app, argc, argv);
}
} // namespace

int main(int argc, char **argv)
{
  for (int i = 0; i < argc; ++i)
    g_command_line.push_back(bole::withoutSecrets(argv[i]));
  return withRoom([&] { return start(argc, argv); });
}
