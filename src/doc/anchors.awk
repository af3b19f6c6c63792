#!/usr/bin/awk -f
# SPDX-License-Identifier: GPL-2.0-or-later
# Gives each heading of a Markdown page the anchor that it has on the web; pictures are found by their name alone.
/^```/ { in_code = !in_code }
!in_code && /^##+ / {
  anchor = tolower($0)
  sub(/^#+ /, "", anchor)
  gsub(/[^a-z0-9 _-]/, "", anchor)
  gsub(/ /, "-", anchor)
  $0 = $0 " {#" anchor "}"
}
{
  gsub(/\]\((\.\.\/)*data\/figures\//, "](")
  print
}
