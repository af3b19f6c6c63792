# SPDX-License-Identifier: GPL-2.0-or-later
# cmake -DSOURCE=... -DOUTPUT=... -P commit.cmake: writes the commit into a header, which changes only with it.
cmake_minimum_required(VERSION 3.24)
find_package(Git QUIET)
set(commit "")
if(GIT_FOUND)
  # root may build what is another user's, which git alone would not read
  execute_process(COMMAND ${GIT_EXECUTABLE} -C ${SOURCE} -c safe.directory=${SOURCE} describe --always --dirty --abbrev=12 --exclude=*
    OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()
if(commit STREQUAL "")
  set(commit unknown)
endif()
file(CONFIGURE OUTPUT ${OUTPUT} CONTENT "#define BOLE_COMMIT \"@commit@\"\n" @ONLY)
