// SPDX-License-Identifier: GPL-2.0-or-later
// bole export: the map and the trajectory of a run for other tools.
#include "commands.h"
#include "geometry/failure.h"

#include "exchange/exchange.h"

#include <algorithm>
#include <cstdio>
#include <fmt/format.h>
#include <memory>
#include <string>

namespace bole::apps
{
void addExport(CLI::App &app)
{
  struct ExportArguments
  {
    std::string run, format, output, origin;
  };
  const auto arguments = std::make_shared<ExportArguments>();
  CLI::App *command = app.add_subcommand("export", "Write the map of a run for other tools");
  std::vector<std::string> names;
  std::string table;
  for (const ExportFormat &format : kExportFormats) {
    names.emplace_back(format.name);
    table += fmt::format("  {:8} {:13} {}\n", format.name, format.file, format.what);
  }
  command->add_option("RUN", arguments->run, "Folder written by `bole track`")->required();
  command->add_option("FORMAT", arguments->format, "One of those below")->required()->check(CLI::IsMember(names));
  command->add_option("-o,--output", arguments->output, "File (colmap: folder) to write (default: in RUN, see below)");
  command->add_option("--origin", arguments->origin,
                      "geojson: LATITUDE,LONGITUDE of the world's origin and HEADING of its x axis, clockwise from "
                      "north [degrees]");
  command->footer("Formats and their files:\n" + table +
                  "Examples:\n"
                  "  bole export run cao\n"
                  "  bole export run geojson --origin 59.34,18.07,90 -o wood.geojson");
  command->callback([arguments] {
    std::optional<GeoOrigin> origin;
    if (!arguments->origin.empty()) {
      if (arguments->format != "geojson")
        throw badValue("--origin: {} has metres alone, must be geojson", arguments->format);
      origin = parseOrigin(arguments->origin);
    }
    const auto format = std::find_if(kExportFormats.begin(), kExportFormats.end(),
                                     [&](const ExportFormat &known) { return known.name == arguments->format; });
    const std::string file = arguments->output.empty() ? arguments->run + "/" + format->file : arguments->output;
    const std::string note = exportRun(arguments->run, arguments->format, file, origin);
    std::printf("%s\n", file.c_str());
    if (!note.empty())
      std::fprintf(stderr, "bole: %s\n", note.c_str());
  });
}
} // namespace bole::apps
