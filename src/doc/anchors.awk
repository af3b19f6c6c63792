#!/usr/bin/awk -f
# SPDX-License-Identifier: GPL-2.0-or-later
# Gives each heading of a Markdown page the anchor that it has on the web, and takes the badges' table of links as it is.
/^```/ { in_code = !in_code }
FILENAME ~ /README.md$/ && !in_code && /^##+ / {
  anchor = tolower($0)
  sub(/^#+ /, "", anchor)
  gsub(/[^a-z0-9 _-]/, "", anchor)
  gsub(/ /, "-", anchor)
  $0 = $0 " {#" anchor "}"
}
{ print }
