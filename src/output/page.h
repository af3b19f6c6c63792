// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// HTML pages in one file: no network, no other files. Charts come from output/svg.h.

#include <string>
#include <string_view>
#include <vector>

namespace bole
{
/// A whole page with the style that all of bole's pages share: it fits telephones and wide screens. \p body is HTML
/// (escaped() makes it from text), \p script is JavaScript that runs when the body is there.
std::string htmlPage(const std::string &title, const std::string &body, const std::string &script = {});

/// A table whose cells are HTML; it scrolls by itself where the screen is narrower.
std::string htmlTable(const std::vector<std::string> &head, const std::vector<std::vector<std::string>> &rows);

/// A chart that keeps its size, so that its text stays legible, and scrolls where the screen is narrower.
std::string chartBox(const std::string &svg);

/// A picture that is part of the page. \p type: "jpeg", "png", "svg+xml".
std::string htmlImage(std::string_view bytes, const char *type, const std::string &description);

std::string base64(std::string_view bytes);
} // namespace bole
