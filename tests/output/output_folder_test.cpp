// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "input/atomic_file.h"
#include <bole/output_folder.h>
#include <sys/stat.h>

namespace
{
using namespace bole;
using test::textOf;
using testing::HasSubstr;
namespace fs = std::filesystem;

const FileNames kNames = {"record.json", "table.csv", "views/*.jpg"};

class OutputFolders : public testing::Test
{
protected:
  void write(const std::string &name, const std::string &text = "somebody's") const
  {
    m_temporary.write("out/" + name, text);
  }
  std::string refusal() const
  {
    return test::messageOf([&] { OutputFolder(m_folder.string(), kNames); });
  }

  test::TemporaryFolder m_temporary;
  const fs::path m_root = m_temporary.path(), m_folder = m_root / "out";
};

TEST_F(OutputFolders, WhatSomebodyElseCalledAlikeIsNotTaken)
{
  write("notes.txt");
  EXPECT_EQ(refusal(), "");
  fs::remove(m_folder / "record.json");
  for (const char *name : {"table.csv", "views/12.jpg", "record.json"}) {
    write(name);
    EXPECT_THAT(refusal(), HasSubstr(std::string(name) + ": was not written by bole")) << name;
    EXPECT_EQ(textOf(m_folder / name), "somebody's");
    fs::remove(m_folder / name);
  }
  write("views/12b.jpg");
  write("views/notes.txt");
  EXPECT_EQ(refusal(), "");
}

TEST_F(OutputFolders, OfAnEarlierRunAreTakenAgain)
{
  {
    const OutputFolder folder(m_folder.string(), kNames);
    EXPECT_TRUE(folder.isNew());
    write("table.csv");
  }
  EXPECT_FALSE(OutputFolder(m_folder.string(), kNames).isNew());
  fs::remove(m_folder / "record.json");
  write("record.json", "{\"versions\": {}}");
  EXPECT_EQ(refusal(), "");
}

TEST_F(OutputFolders, OnlyTemporaryFilesOfTheirOwnNamesAreCleared)
{
  write(".table.partial.csv");
  write(".table~2.partial.csv");
  write(".other.partial.csv");
  ASSERT_EQ(refusal(), "");
  EXPECT_FALSE(fs::exists(m_folder / ".table.partial.csv"));
  EXPECT_FALSE(fs::exists(m_folder / ".table~2.partial.csv"));
  EXPECT_TRUE(fs::exists(m_folder / ".other.partial.csv"));
}

TEST_F(OutputFolders, OnlyTheirOwnFilesAreRemoved)
{
  for (const char *name : {"record.json", "table.csv", "views/1.jpg", "views/a.jpg", "views/2/1.jpg", "deep/table.csv"})
    write(name);
  write("../far/1.jpg");
  fs::create_symlink(m_root / "far/1.jpg", m_folder / "views/3.jpg");
  EXPECT_EQ(firstForeign(m_folder.string(), {"record.json"}).empty(), false);
  removeFiles(m_folder.string(), kNames);
  for (const char *gone : {"record.json", "table.csv", "views/1.jpg"})
    EXPECT_FALSE(fs::exists(m_folder / gone)) << gone;
  for (const char *kept : {"views/a.jpg", "views/2/1.jpg", "deep/table.csv", "views/3.jpg", "../far/1.jpg"})
    EXPECT_TRUE(fs::exists(m_folder / kept)) << kept;
}

TEST_F(OutputFolders, ThatHoldNothingElseAreRemovedWithTheirFiles)
{
  write("views/1.jpg");
  write("table.csv");
  EXPECT_EQ(firstForeign(m_folder.string(), kNames), "");
  removeFiles(m_folder.string() + "/", kNames);
  EXPECT_FALSE(fs::exists(m_folder));
}

TEST_F(OutputFolders, ALinkToAFolderIsNotEnteredAndOneThatLeadsOutOfThemRefused)
{
  m_temporary.write("far/table.csv", "somebody's");
  fs::create_directory_symlink(m_root / "far", m_folder);
  removeFiles(m_folder.string(), kNames);
  EXPECT_TRUE(fs::exists(m_root / "far/table.csv"));
  fs::remove(m_folder);
  fs::create_directories(m_folder);
  fs::create_directory_symlink(m_root / "far", m_folder / "views");
  EXPECT_THAT(refusal(), HasSubstr("out/views: is a link, must be a folder"));
}

TEST_F(OutputFolders, AnAtomicFileTakesThePlaceOfFilesAlone)
{
  write("table.csv");
  write(".table.partial.csv", "of a process that was killed, or somebody's");
  fs::create_symlink(m_folder / "table.csv", m_folder / "link.csv");
  writeAtomically((m_folder / "link.csv").string(), "new");
  EXPECT_EQ(textOf(m_folder / "table.csv"), "somebody's");
  writeAtomically((m_folder / "table.csv").string(), "new");
  EXPECT_EQ(textOf(m_folder / "table.csv"), "new");
  EXPECT_FALSE(fs::is_symlink(m_folder / "link.csv"));
  EXPECT_THAT(textOf(m_folder / ".table.partial.csv"), HasSubstr("somebody's"));
  ASSERT_EQ(::mkfifo((m_folder / "pipe").c_str(), 0600), 0);
  for (const std::string &path : {(m_folder / "pipe").string(), m_folder.string()})
    EXPECT_THROW(writeAtomically(path, "new"), vpException) << path;
  EXPECT_TRUE(fs::is_fifo(m_folder / "pipe"));
}

TEST_F(OutputFolders, AGrowingFileHasEachLineAtOnce)
{
  write("table.csv", "old\n");
  GrowingFile file((m_folder / "table.csv").string(), "head\n");
  file.add("a\n");
  EXPECT_EQ(textOf(m_folder / "table.csv"), "head\na\n");
  file.add("b\n");
  EXPECT_EQ(textOf(m_folder / "table.csv"), "head\na\nb\n");
}
} // namespace
