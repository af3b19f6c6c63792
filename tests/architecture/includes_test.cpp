// SPDX-License-Identifier: GPL-2.0-or-later
// The arrows between the stages: src/CMakeLists.txt lists them, the sources must agree.
#include "architecture/include_graph.h"

#include <gmock/gmock.h>

namespace
{
namespace fs = std::filesystem;
using bole::test::IncludeGraph;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::size_t kMostPublicHeaders = 27;

/// A tree of two or three stages in a folder of its own.
class SmallTree : public testing::Test
{
protected:
  SmallTree()
  {
    write("include/bole/pose.h", "");
    write("src/geometry/pose.cpp", "#include <bole/pose.h>\n");
    write("src/map/map.h", "#include <bole/pose.h>\n");
    write("src/CMakeLists.txt", "\nbole_add_stage(geometry)\nbole_add_stage(map DEPENDS geometry)\n");
  }

  void write(const std::string &name, const std::string &text) const { m_folder.write(name, text); }
  std::vector<std::string> faults() const { return IncludeGraph(m_root).faults(); }

  bole::test::TemporaryFolder m_folder;
  const fs::path m_root = m_folder.path();
};
} // namespace

TEST(Architecture, StagesSeeWhatTheyMayAndNeedWhatTheyMay)
{
  EXPECT_THAT(IncludeGraph(BOLE_SOURCE_DIR).faults(), IsEmpty());
}

TEST(Architecture, TheLaboratorySeesPublicHeadersAlone)
{
  EXPECT_THAT(IncludeGraph(BOLE_SOURCE_DIR).laboratoryFaults(), IsEmpty());
}

TEST(Architecture, WhereViSPIsUsedItsNamespaceIsOpen)
{
  EXPECT_THAT(IncludeGraph(BOLE_SOURCE_DIR).namespaceFaults(), IsEmpty());
}

TEST(Architecture, PublicHeadersAreFew)
{
  EXPECT_LE(IncludeGraph(BOLE_SOURCE_DIR).publicHeaders(), kMostPublicHeaders);
}

TEST_F(SmallTree, IsSound) { EXPECT_THAT(faults(), IsEmpty()); }

TEST_F(SmallTree, AClassOfViSPWithoutItsNamespaceIsFound)
{
  write("src/map/image.h", "#include <visp3/core/vpImage.h>\n");
  write("src/map/opened.h", "#include \"map/opens.h\"\n#include <visp3/core/vpImage.h>\n");
  write("src/map/opens.h", "#include <bole/visp.h>\n");
  write("include/bole/visp.h", "#include <visp3/core/vpConfig.h>\n");
  EXPECT_THAT(IncludeGraph(m_root).namespaceFaults(),
              ElementsAre("src/map/image.h includes <visp3/core/vpImage.h> without <bole/visp.h>"));
}

TEST_F(SmallTree, APrivateHeaderInTheLaboratoryIsFoundAlsoByWayOfTheCommands)
{
  write("src/lab/paper/mapper.h", "#include <bole/pose.h>\n");
  write("apps/commands.h", "");
  write("apps/lab/reproduce.cpp", "#include \"commands.h\"\n#include \"paper/mapper.h\"\n");
  EXPECT_THAT(IncludeGraph(m_root).laboratoryFaults(), IsEmpty());
  EXPECT_THAT(faults(), IsEmpty()) << "it is no stage";
  write("src/lab/paper/mapper.h", "#include \"map/map.h\"\n");
  write("apps/commands.h", "#include \"geometry/names.h\"\n");
  EXPECT_THAT(IncludeGraph(m_root).laboratoryFaults(), ElementsAre("src/lab/paper/mapper.h includes \"map/map.h\"",
                                                                   "apps/commands.h includes \"geometry/names.h\""));
}

TEST_F(SmallTree, AnArrowThatIsNotListedIsFound)
{
  write("src/geometry/camera.cpp", "#include \"map/map.h\"\n");
  EXPECT_THAT(faults(), ElementsAre("src/geometry/camera.cpp sees src/map/map.h: geometry may not know map"));
}

TEST_F(SmallTree, WhatAHeaderPassesOnIsAnArrow)
{
  write("src/output/output.cpp", "#include \"map/map.h\"\n");
  write("src/CMakeLists.txt", "\nbole_add_stage(geometry)\nbole_add_stage(map DEPENDS geometry)\n"
                              "bole_add_stage(output DEPENDS map)\n");
  EXPECT_THAT(faults(), ElementsAre("src/output/output.cpp sees include/bole/pose.h: output may not know geometry"));
}

TEST_F(SmallTree, AnArrowThatNobodyNeedsIsFound)
{
  write("src/map/map.h", "#include <vector>\n");
  EXPECT_THAT(faults(), ElementsAre("map is allowed to know geometry and does not need to"));
}

TEST_F(SmallTree, AnArrowUpwardsInTheListIsFound)
{
  write("src/CMakeLists.txt", "\nbole_add_stage(map DEPENDS geometry)\nbole_add_stage(geometry)\n");
  EXPECT_THAT(faults(), ElementsAre("map depends on geometry, which is no earlier stage"));
}

TEST_F(SmallTree, APublicHeaderOfNoStageIsFound)
{
  write("include/bole/lost.h", "");
  EXPECT_THAT(faults(),
              ElementsAre("include/bole/lost.h belongs to no stage: name it after HEADERS, or implement it in "
                          "src/<stage>"));
  write("src/CMakeLists.txt", "\nbole_add_stage(geometry HEADERS lost)\nbole_add_stage(map DEPENDS geometry)\n");
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(SmallTree, APublicHeaderThatIncludesAPrivateOneIsFound)
{
  write("include/bole/pose.h", "#include \"map/map.h\"\n#include <opencv2/core.hpp>\n#include <vector>\n");
  EXPECT_THAT(IncludeGraph(m_root).publicFaults(), ElementsAre("include/bole/pose.h includes \"map/map.h\"",
                                                               "include/bole/pose.h includes <opencv2/core.hpp>"));
}
