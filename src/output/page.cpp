// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/page.h"

#include "output/palette.h"
#include "output/svg.h"

#include <fmt/format.h>

namespace bole
{
namespace
{
constexpr const char *kStyle = R"(
*{box-sizing:border-box}
body{font:15px/1.45 system-ui,sans-serif;color:#222;background:#fff;max-width:1500px;margin:0 auto;padding:0 1em 3em}
h1{font-size:1.5em;overflow-wrap:anywhere}h2{font-size:1.15em;margin:1.8em 0 .5em;border-bottom:1px solid #ddd}
.wide{overflow-x:auto}
table{border-collapse:collapse;font-variant-numeric:tabular-nums}
td,th{padding:2px 8px;text-align:right;white-space:nowrap}td:first-child,th:first-child{text-align:left}
th{white-space:normal;vertical-align:bottom}
tr:nth-child(even){background:#f4f4f4}
img,video{max-width:100%;height:auto}
code{overflow-wrap:anywhere;background:#f4f4f4;padding:0 .25em}
button{font:inherit;min-width:2.2em;min-height:2em;border:1px solid #bbb;border-radius:4px;background:#fff}
)";
} // namespace

std::string base64(std::string_view bytes)
{
  constexpr const char *kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned group = 0;
    for (std::size_t k = 0; k < 3; ++k)
      group = group << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k)
      text += i + k <= bytes.size() ? kDigits[group >> (18 - 6 * k) & 63u] : '=';
  }
  return text;
}

std::string htmlImage(std::string_view bytes, const char *type, const std::string &description)
{
  return fmt::format("<img alt=\"{}\" src=\"data:image/{};base64,{}\">", escaped(description), type, base64(bytes));
}

std::string htmlTable(const std::vector<std::string> &head, const std::vector<std::vector<std::string>> &rows)
{
  std::string html = "<div class=\"wide\"><table>\n<tr>";
  for (const std::string &cell : head)
    html += "<th>" + cell + "</th>";
  html += "</tr>\n";
  for (const auto &row : rows) {
    html += "<tr>";
    for (const std::string &cell : row)
      html += "<td>" + cell + "</td>";
    html += "</tr>\n";
  }
  return html + "</table></div>\n";
}

std::string chartBox(const std::string &svg) { return "<div class=\"wide chart\">" + svg + "</div>\n"; }

std::string htmlPage(const std::string &title, const std::string &body, const std::string &script)
{
  std::string page =
      fmt::format("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
                  "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n"
                  "<link rel=\"icon\" "
                  "href=\"data:,\">\n<title>{}</title>\n<style>{}a{{color:{}}}</style></head>\n<body>\n<h1>{}</h1>\n",
                  escaped(title), kStyle, palette::kBlue, escaped(title));
  page += body;
  if (!script.empty())
    page += "<script>\n" + script + "</script>\n";
  return page + "</body></html>\n";
}
} // namespace bole
