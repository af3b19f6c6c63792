// SPDX-License-Identifier: GPL-2.0-or-later
// The hidden command that writes man pages and completions for bash and zsh from the definitions of all commands.
#include "commands.h"

#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>

namespace bole::apps
{
namespace
{
namespace fs = std::filesystem;
using Commands = std::vector<const CLI::App *>;

/// The commands below \p app that a user sees.
Commands commandsOf(const CLI::App &app)
{
  Commands commands;
  for (const CLI::App *command : app.get_subcommands([](const CLI::App *) { return true; }))
    if (!command->get_group().empty())
      commands.push_back(command);
  return commands;
}

/// "bole servo hold" for the command hold of servo.
std::string fullName(const CLI::App &app)
{
  const CLI::App *parent = app.get_parent();
  return parent == nullptr ? app.get_name() : fullName(*parent) + " " + app.get_name();
}

std::string replaced(std::string text, char from, const std::string &to)
{
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
    text.replace(at, 1, to);
  return text;
}

/// Text as troff prints it unchanged.
std::string roff(const std::string &text)
{
  std::string safe = replaced(replaced(text, '\\', "\\e"), '-', "\\-");
  std::string lines;
  std::istringstream stream(safe);
  for (std::string line; std::getline(stream, line);)
    lines += (line.rfind('.', 0) == 0 || line.rfind('\'', 0) == 0 ? "\\&" : "") + line + "\n";
  return lines;
}

std::string oneLine(const std::string &text) { return replaced(text, '\n', " "); }

/// Its flags, or its name in capitals where it goes by its place.
std::string flagsOf(const CLI::Option &option) { return option.get_name(option.get_positional(), true); }

bool takesValue(const CLI::Option &option) { return option.get_items_expected_max() > 0; }

void writeOptions(std::ostream &out, const CLI::App &app)
{
  for (const CLI::Option *option : app.get_options()) {
    out << ".TP\n.B " << roff(flagsOf(*option) + (takesValue(*option) && !option->get_positional() ? " VALUE" : ""))
        << roff(oneLine(option->get_description()));
    if (!option->get_default_str().empty())
      out << roff("Default: " + option->get_default_str() + ".");
  }
}

void writePage(const fs::path &path, const CLI::App &app, const std::string &version)
{
  std::ofstream out(path);
  const std::string name = fullName(app);
  const Commands commands = commandsOf(app);
  out << ".TH " << replaced(name, ' ', "\\-") << " 1 \"\" \"" << version << "\" \"bole\"\n"
      << ".SH NAME\n"
      << roff(replaced(name, ' ', "-") + " - " + oneLine(app.get_description())) << ".SH SYNOPSIS\n.B " << roff(name)
      << roff(commands.empty() ? "[OPTIONS] ..." : "COMMAND [OPTIONS] ...") << ".SH OPTIONS\n";
  writeOptions(out, app);
  if (!commands.empty())
    out << ".SH COMMANDS\n";
  for (const CLI::App *command : commands)
    out << ".TP\n.B " << roff(replaced(fullName(*command), ' ', "-") + "(1)")
        << roff(oneLine(command->get_description()));
  if (!app.get_footer().empty())
    out << ".SH NOTES\n.nf\n" << roff(app.get_footer()) << ".fi\n";
}

/// One page a command: bole.1, bole-track.1, bole-servo-hold.1.
void writePages(const fs::path &folder, const CLI::App &app, const std::string &version)
{
  writePage(folder / (replaced(fullName(app), ' ', "-") + ".1"), app, version);
  for (const CLI::App *command : commandsOf(app))
    writePages(folder, *command, version);
}

std::string flagWords(const CLI::App &app)
{
  std::string words;
  for (const CLI::Option *option : app.get_options())
    if (!option->get_positional()) {
      for (const std::string &name : option->get_lnames())
        words += " --" + name;
      for (const std::string &name : option->get_snames())
        words += " -" + name;
    }
  for (const CLI::App *command : commandsOf(app))
    words += " " + command->get_name();
  return words.empty() ? words : words.substr(1);
}

void writeBashCases(std::ostream &out, const CLI::App &app)
{
  out << "    '" << fullName(app) << "') words='" << flagWords(app) << "' ;;\n";
  for (const CLI::App *command : commandsOf(app))
    writeBashCases(out, *command);
}

/// The words of the command typed so far, files for everything else.
void writeBash(const fs::path &path, const CLI::App &app)
{
  std::ofstream out(path);
  out << "# completion of bole for bash\n"
         "_bole()\n"
         "{\n"
         "  local command=bole words='' i\n"
         "  for ((i = 1; i < COMP_CWORD; ++i)); do\n"
         "    [[ ${COMP_WORDS[i]} == -* ]] && break\n"
         "    command+=\" ${COMP_WORDS[i]}\"\n"
         "    ((i == 2)) && break\n"
         "  done\n"
         "  while :; do\n"
         "    _bole_words \"$command\" && break\n"
         "    [[ $command == *' '* ]] || break\n"
         "    command=${command% *}\n"
         "  done\n"
         "  mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"${COMP_WORDS[COMP_CWORD]}\")\n"
         "}\n"
         "_bole_words()\n"
         "{\n"
         "  case \"$1\" in\n";
  writeBashCases(out, app);
  out << "    *) return 1 ;;\n"
         "  esac\n"
         "}\n"
         "complete -o default -F _bole bole\n";
}

std::string zshQuoted(const std::string &text)
{
  return replaced(replaced(replaced(replaced(oneLine(text), '\'', "'\\''"), '[', "\\["), ']', "\\]"), ':', "\\:");
}

std::string zshName(const CLI::App &app) { return "_" + replaced(replaced(fullName(app), ' ', "_"), '-', "_"); }

void writeZshFunction(std::ostream &out, const CLI::App &app)
{
  const Commands commands = commandsOf(app);
  out << zshName(app) << "()\n{\n  _arguments -C";
  for (const CLI::Option *option : app.get_options()) {
    const std::string what =
        "[" + zshQuoted(option->get_description()) + "]" + (takesValue(*option) ? ":value:_files'" : "'");
    for (const std::string &name : option->get_lnames())
      out << " \\\n    '--" << name << what;
    for (const std::string &name : option->get_snames())
      out << " \\\n    '-" << name << what;
  }
  if (commands.empty()) {
    out << " \\\n    '*:file:_files'\n}\n";
    return;
  }
  out << " \\\n    '1:command:((";
  for (const CLI::App *command : commands)
    out << command->get_name() << "\\:\"" << replaced(zshQuoted(command->get_description()), '"', "") << "\" ";
  out << "))' \\\n    '*::argument:->arguments'\n  [[ $state == arguments ]] || return\n  case $words[1] in\n";
  for (const CLI::App *command : commands)
    out << "  " << command->get_name() << ") " << zshName(*command) << " ;;\n";
  out << "  esac\n}\n";
  for (const CLI::App *command : commands)
    writeZshFunction(out, *command);
}

void writeZsh(const fs::path &path, const CLI::App &app)
{
  std::ofstream out(path);
  out << "#compdef bole\n";
  writeZshFunction(out, app);
  out << "_bole \"$@\"\n";
}
} // namespace

void addDocumentation(CLI::App &app, const std::string &version)
{
  const auto folder = std::make_shared<std::string>();
  CLI::App *command = app.add_subcommand("documentation", "Write man pages and completions")->group("");
  command->add_option("FOLDER", *folder, "gets *.1, bole.bash and _bole")->required();
  command->callback([&app, folder, version] {
    fs::create_directories(*folder);
    writePages(*folder, app, version);
    writeBash(fs::path(*folder) / "bole.bash", app);
    writeZsh(fs::path(*folder) / "_bole", app);
  });
}
} // namespace bole::apps
