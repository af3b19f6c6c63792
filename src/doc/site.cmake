# SPDX-License-Identifier: GPL-2.0-or-later
# The README's pictures of the demonstration flight by this build: cmake --build --preset release --target figures
# (Debian: python3-opencv python3-matplotlib python3-pil).
set(figures_run ${PROJECT_BINARY_DIR}/figures)
set(draw ${CMAKE_CURRENT_LIST_DIR}/figures.py)
add_custom_target(figures WORKING_DIRECTORY ${PROJECT_SOURCE_DIR} VERBATIM
  COMMAND bole track data/park-forward -o ${figures_run}
  COMMAND ${CMAKE_COMMAND} -E copy ${figures_run}/map.svg data/figures/park-forward-map.svg
  COMMAND /usr/bin/python3 ${draw} gif ${figures_run}/overlay.mp4 data/figures/park-forward.gif
  COMMAND /usr/bin/python3 ${draw} system ${figures_run} data/park-forward data/figures/system.png)

# The site of the documentation in build/PRESET/site: cmake --build --preset release --target doc
# Needs Debian's doxygen and libjs-mathjax: formulas are typeset in the browser.
find_package(Doxygen 1.9 QUIET)
find_path(BOLE_MATHJAX MathJax.js PATHS /usr/share/javascript/mathjax NO_DEFAULT_PATH)
if(NOT DOXYGEN_FOUND OR NOT BOLE_MATHJAX)
  return()
endif()
set(DOXYGEN_PROJECT_BRIEF "${PROJECT_DESCRIPTION}")
set(DOXYGEN_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR})
set(DOXYGEN_HTML_OUTPUT site)
set(DOXYGEN_USE_MDFILE_AS_MAINPAGE ${PROJECT_SOURCE_DIR}/README.md)
set(DOXYGEN_FILE_PATTERNS *.h *.md)
set(DOXYGEN_EXTRACT_ALL NO)
set(DOXYGEN_WARN_AS_ERROR FAIL_ON_WARNINGS)
set(DOXYGEN_JAVADOC_AUTOBRIEF YES)
set(DOXYGEN_STRIP_FROM_PATH ${PROJECT_SOURCE_DIR}/include ${PROJECT_SOURCE_DIR})
set(DOXYGEN_STRIP_FROM_INC_PATH ${PROJECT_SOURCE_DIR}/include)
set(DOXYGEN_IMAGE_PATH ${PROJECT_SOURCE_DIR}/data/figures)
set(DOXYGEN_EXAMPLE_PATH ${PROJECT_SOURCE_DIR}/tests/install)
set(DOXYGEN_GENERATE_TREEVIEW YES)
set(DOXYGEN_TREEVIEW_WIDTH 320)
set(DOXYGEN_HTML_EXTRA_STYLESHEET ${CMAKE_CURRENT_LIST_DIR}/site.css)
set(DOXYGEN_HAVE_DOT NO)
set(DOXYGEN_QUIET YES)
# headings of Markdown get the anchors that they have on the web, so that one source serves both
set(DOXYGEN_FILTER_PATTERNS *.md=${CMAKE_CURRENT_LIST_DIR}/anchors.awk)
set(DOXYGEN_USE_MATHJAX YES)
set(DOXYGEN_MATHJAX_RELPATH mathjax)
# in the order in which they are read: what is not named here comes after the classes
set(pages tutorial-map tutorial-video tutorial-localise tutorial-compare tutorial-servo tutorial-ardrone tutorial-python
  tutorial-graph tutorial-energy concepts formats options troubleshooting paper deviations accuracy saliency points smoothing
  visp-trackers servoing ardrone campaigns speed faults)
list(TRANSFORM pages PREPEND ${CMAKE_CURRENT_LIST_DIR}/)
list(TRANSFORM pages APPEND .md)
doxygen_add_docs(doc ${PROJECT_SOURCE_DIR}/README.md ${pages} ${PROJECT_SOURCE_DIR}/models/README.md
  ${PROJECT_SOURCE_DIR}/CONTRIBUTING.md ${PROJECT_SOURCE_DIR}/src/doc ${PROJECT_SOURCE_DIR}/include
  COMMENT "Making the documentation in ${PROJECT_BINARY_DIR}/site")
add_custom_command(TARGET doc POST_BUILD COMMAND ${CMAKE_COMMAND} -E make_directory ${PROJECT_BINARY_DIR}/site/mathjax
    COMMAND cp -rL ${BOLE_MATHJAX}/MathJax.js ${BOLE_MATHJAX}/config ${BOLE_MATHJAX}/extensions ${BOLE_MATHJAX}/jax
      ${BOLE_MATHJAX}/fonts ${PROJECT_BINARY_DIR}/site/mathjax VERBATIM)
