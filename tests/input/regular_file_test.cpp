// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/csv_reader.h"
#include "input/regular_file.h"
#include "input/yaml_file.h"
#include "messages.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <sys/stat.h>
#include <unistd.h>

namespace
{
using namespace bole;
using test::messageOf;
using testing::HasSubstr;
namespace fs = std::filesystem;

/// A folder with one of each that is no file.
class RegularFile : public testing::Test
{
protected:
  void SetUp() override
  {
    fs::create_directory(m_folder);
    ASSERT_EQ(::mkfifo(at("pipe").c_str(), 0600), 0);
    fs::create_symlink("/dev/zero", at("link_to_device"));
    std::ofstream(at("text"), std::ios::binary) << "\xEF\xBB\xBF"
                                                   "one\r\ntwo\n\nlast";
  }
  void TearDown() override { fs::remove_all(m_folder); }
  std::string at(const std::string &name) const { return m_folder + "/" + name; }

  std::string m_folder = testing::TempDir() + "regular_file_test_" + std::to_string(::getpid());
};

TEST_F(RegularFile, NothingElseIsOpenedByAnyReader)
{
  const std::vector<std::pair<std::string, std::string>> others = {
      {at("pipe"), "is a pipe, socket or device, must be a file"},
      {at("link_to_device"), "is a pipe, socket or device, must be a file"},
      {"/dev/null", "is a pipe, socket or device, must be a file"},
      {m_folder, "is a folder, must be a file"},
      {at("none"), "no such file"}};
  for (const auto &[path, what] : others)
    for (const std::string &message :
         {messageOf([&] { openRegularFile(path); }), messageOf([&] { readWholeFile(path, 10); }),
          messageOf([&] { TextLines{path}; }), messageOf([&] {
            CsvReader{path, {}};
          }),
          messageOf([&] { loadYaml(path); })})
      EXPECT_EQ(message, path + ": " + what);
}

TEST_F(RegularFile, IsReadUpToALimit)
{
  EXPECT_EQ(readWholeFile(at("text"), 100).size(), 17u);
  EXPECT_THAT(messageOf([&] { readWholeFile(at("text"), 16); }), HasSubstr("text: 17 bytes, must be at most 16"));
}

TEST_F(RegularFile, LinesLoseTheirEndsAndTheMarkOfTheFile)
{
  TextLines lines(at("text"));
  std::vector<std::string> read;
  while (lines.next())
    read.push_back(lines.line());
  EXPECT_THAT(read, testing::ElementsAre("one", "two", "", "last"));
}

TEST_F(RegularFile, ALineWithoutEndIsRefusedBeforeItIsRead)
{
  fs::resize_file(at("text"), std::uintmax_t{1} << 40); // a hole, which takes no room on the disk
  TextLines lines(at("text"));
  EXPECT_THAT(messageOf([&] {
                while (lines.next()) {
                }
              }),
              HasSubstr("text:4: more than 100000 characters in a line"));
}
} // namespace
