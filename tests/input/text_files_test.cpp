// SPDX-License-Identifier: GPL-2.0-or-later
#include "flight_folder.h"
#include "support/test.h"

#include "input/csv_reader.h"
#include "input/recorded_source.h"
#include "input/regular_file.h"
#include "input/trajectory.h"
#include "input/user_text.h"
#include "input/yaml_file.h"
#include <bole/open_source.h>
#include <sys/stat.h>

namespace
{
using namespace bole;
using test::FlightFolder;
using test::messageOf;
using testing::ElementsAre;
using testing::HasSubstr;
namespace fs = std::filesystem;

/// A folder with one of each that is no file.
class RegularFile : public testing::Test
{
protected:
  void SetUp() override
  {
    ASSERT_EQ(::mkfifo(at("pipe").c_str(), 0600), 0);
    fs::create_symlink("/dev/zero", at("link_to_device"));
    m_folder.write("text", "\xEF\xBB\xBF"
                           "one\r\ntwo\n\nlast");
  }
  std::string at(const std::string &name) const { return m_folder / name; }

  test::TemporaryFolder m_folder;
};

TEST_F(RegularFile, NothingElseIsOpenedByAnyReader)
{
  const std::vector<std::pair<std::string, std::string>> others = {
      {at("pipe"), "is a pipe, socket or device, must be a file"},
      {at("link_to_device"), "is a pipe, socket or device, must be a file"},
      {"/dev/null", "is a pipe, socket or device, must be a file"},
      {m_folder.path(), "is a folder, must be a file"},
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
  EXPECT_REFUSED("text: 17 bytes, must be at most 16", readWholeFile(at("text"), 16));
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

TEST(Secrets, NamesAndPasswordsLeaveAddresses)
{
  EXPECT_EQ(withoutSecrets("http://user:secret@host:80/a.mjpg"), "http://host:80/a.mjpg");
  EXPECT_EQ(withoutSecrets("rtsp://user@host"), "rtsp://host");
  EXPECT_EQ(withoutSecrets("rtsp://:secret@[::1]:554/1"), "rtsp://[::1]:554/1");
  EXPECT_EQ(withoutSecrets("http://user:s@e:c@ret@host/x"), "http://host/x");
  EXPECT_EQ(withoutSecrets("http://user:sec/ret?#@host/x"), "http://host/x");
  EXPECT_EQ(withoutSecrets("http://u:secret@a/1: no video, nor at http://u:secret@b/2: it is closed"),
            "http://a/1: no video, nor at http://b/2: it is closed");
  EXPECT_EQ(withoutSecrets("http://host/v?Token=abc&size=2&access_key=x#t"),
            "http://host/v?Token=***&size=2&access_key=***#t");
  EXPECT_EQ(withoutSecrets("rtsp://host/user=admin&password=abc&channel=1: closed"),
            "rtsp://host/user=admin&password=***&channel=1: closed");
}

TEST(Secrets, OtherTextStays)
{
  for (const char *text :
       {"", "flight", "user:secret@host", "a://", "http://host:8080/a@b.mp4", "http://[::1]:80/@x",
        "ardrone://192.168.1.1?offset=10&camera=my.yaml", "http://cam:8080: no video", "--set detection.key=2"})
    EXPECT_EQ(withoutSecrets(text), text);
}

std::string refusalOf(const std::string &text)
{
  const test::TemporaryFolder folder;
  const std::string path = folder.write("yaml_file_test.yaml", text);
  const std::string message = messageOf([&] { loadYaml(path); });
  if (!message.empty()) {
    EXPECT_EQ(messageOf([&] { readCamera(path); }), message) << "a camera file is read by the same loader";
  }
  return message;
}

std::string repeated(const std::string &text, int count)
{
  std::string all;
  for (int i = 0; i < count; ++i)
    all += text;
  return all;
}

TEST(YamlFile, WhatCannotBeReadIsRefusedWithItsLine)
{
  std::string indented;
  for (int depth = 0; depth < 400; ++depth)
    indented += std::string(static_cast<std::size_t>(depth), ' ') + "a:\n";
  const std::pair<std::string, const char *> cases[] = {
      {"a: 1\nb: &b [1, *b]\n", "yaml_file_test.yaml:2: is nested deeper"},
      {"a: &a\n  b: *a\n", "holds itself by an alias"},
      {"&a {b: &b {a: *a, b: *b}, c: *a}\n", "by an alias"},
      {"a: 1\nb: " + repeated("[", 200000) + "\n", ":2: is nested deeper than 32"},
      {"a: " + repeated("{a: ", 100) + "\n", ":1: is nested deeper than 32"},
      {indented, "is nested deeper than 32"},
      {repeated("- ", 100000) + "1\n", "yaml_file_test.yaml:1: "},
      {repeated("? ", 100000) + "1\n", "yaml_file_test.yaml:1: "},
      {std::string("\xFF\xFE\x61\0:\0", 6), "yaml_file_test.yaml:1: is no text in UTF-8"},
      {std::string("a: 1\nb: \0\n", 10), ":2: is no text in UTF-8"},
      {"a: 1\n? [1, 2]\n: 3\n", ":2: a key must be one word"},
      {"a: *nowhere\n", "yaml_file_test.yaml:1: "},
      {"a: 1\n" + std::string(2000000, ' '), "must be at most 1000000"}};
  for (const auto &[text, part] : cases)
    EXPECT_THAT(refusalOf(text), HasSubstr(part)) << text.substr(0, 40);
  EXPECT_THAT(refusalOf("a: 1\nb: [1, 2\nc: 3\n"), testing::MatchesRegex(".*yaml_file_test.yaml:[0-9]+: .*"));
}

TEST(YamlFile, TheMarkOfUtf8AndAliasesThatDoNoHarmAreRead)
{
  EXPECT_EQ(refusalOf("\xEF\xBB\xBF"
                      "a: 1\n"),
            "");
  EXPECT_EQ(refusalOf("a: &a [1, 2]\nb: *a\nc: [*a, *a]\n"), "");
}

class Tables : public testing::Test
{
protected:
  std::string write(const std::string &text) const { return m_flight.write("table.csv", text); }
  std::vector<std::vector<std::string>> rowsOf(const std::string &text, const CsvFormat &format = {}) const
  {
    std::vector<std::vector<std::string>> rows;
    for (CsvReader csv(write(text), format); csv.next();) {
      rows.emplace_back();
      for (std::size_t i = 0; i < csv.columns(); ++i)
        rows.back().push_back(csv.text(i));
    }
    return rows;
  }
  std::string refusal(const std::string &text) const
  {
    return messageOf([&] { readTrajectory(write(text)); });
  }
  FlightFolder m_flight{1};
};
} // namespace

TEST_F(Tables, GiveBackEveryTextThatWasWritten)
{
  const std::vector<std::string> texts = {"plain",  "a, b",     "say \"no\"", "two\nlines", "woods; south",
                                          " blank", "# remark", "\"",         "",           "\xC3\xA4"};
  std::string table;
  for (const std::string &text : texts)
    table += "1," + csvField(text) + "\n" + csvField(text) + ",2\n";
  const auto rows = rowsOf(table, {2});
  ASSERT_EQ(rows.size(), 2 * texts.size());
  for (std::size_t i = 0; i < texts.size(); ++i) {
    EXPECT_THAT(rows[2 * i], ElementsAre("1", texts[i]));
    EXPECT_THAT(rows[2 * i + 1], ElementsAre(texts[i], "2"));
  }
  EXPECT_EQ(csvField("plain"), "plain");
}

TEST_F(Tables, AreReadWhereEveryFieldIsQuoted)
{
  EXPECT_THAT(rowsOf("\"stamp\",\"name\"\n\"0\",\"a.png\"\n\"5\",\"b.png\"\r\n"),
              ElementsAre(ElementsAre("0", "a.png"), ElementsAre("5", "b.png")));
  EXPECT_REFUSED("table.csv:1: a quote is never closed", rowsOf("1,\"a\n2,b\n3,c\n"));
  EXPECT_EQ(refusal("\"t\",\"x\",\"y\",\"z\",\"w\",\"x\",\"y\",\"z\"\n"
                    "\"0\",\"0\",\"0\",\"1\",\"1\",\"0\",\"0\",\"0\"\n"),
            "");
}

TEST_F(Tables, HaveOneHeaderAtMostAndNoRowIsTakenForIt)
{
  const char *const row = "0,0,0,1,1,0,0,0\n";
  EXPECT_EQ(refusal(std::string("time,x,y,z,qw,qx,qy,qz\n") + row), "");
  EXPECT_EQ(refusal(std::string("%time,field.x,y,z,qw,qx,qy,qz\n") + row), "");
  EXPECT_THAT(
      refusal("%time,field.header.seq,field.header.frame_id,field.x,y,z,qw,qx,qy,qz\n0,0,world,0,0,1,1,0,0,0\n"),
      HasSubstr("table.csv:2: the columns are those of `rostopic echo -p`"));
  EXPECT_THAT(refusal("0.0,0,0,1,1,0,0,0\n0.1,0,0,1,1,0,0,0\n"),
              HasSubstr("table.csv:1: timestamp = 0.0 looks like seconds"));
  EXPECT_THAT(refusal(std::string("O,0,0,1,1,0,0,0\n") + row), HasSubstr("table.csv:1: timestamp = \"O\""));
  EXPECT_THAT(refusal(std::string("t,x,y,z,qw,qx,qy,qz\nt,x,y,z,qw,qx,qy,qz\n") + row),
              HasSubstr("table.csv:2: timestamp = \"t\""));
  m_flight.write("mav0/cam0/data.csv", "x0,0000.png\n100000000,0001.png\n");
  EXPECT_REFUSED("data.csv:1: timestamp = \"x0\"", AslSource(m_flight.path()));
}

TEST_F(Tables, TellWhatSeparatesTheirColumns)
{
  EXPECT_REFUSED("separated by tabs, must be by commas", rowsOf("0\t1\n", {2}));
  EXPECT_REFUSED("separated by blanks, must be by commas", rowsOf("0 1\n", {2}));
  EXPECT_REFUSED("separated by semicolons, must be by commas", rowsOf("0;1\n", {2}));
  EXPECT_REFUSED("by commas, must be by blanks", rowsOf("0,1,2\n", {2, ' ', {}}));
  EXPECT_THAT(refusal("0;0;0;1;0;0;0;1\n"), HasSubstr("separated by semicolons"));
  EXPECT_THAT(refusal("0,0;0,1;0,2;1,0;0,0;0,0;0,0;1,0\n"), HasSubstr("with a point"));
  EXPECT_THAT(refusal("0,5 0,1 0,2 1,0 0,0 0,0 0,0 1,0\n"), HasSubstr("with a point"));
  EXPECT_THAT(refusal("\"0,5\" 0 0 1 0 0 0 1\n"), HasSubstr("with a point"));
  EXPECT_EQ(refusal("0, 0, 0, 1, 1, 0, 0, 0\n"), "");
  EXPECT_EQ(refusal("0.5\t0\t0\t1\t0\t0\t0\t1\n"), "");
}

TEST_F(Tables, TellWhichOtherFormOfATrajectoryTheyHave)
{
  EXPECT_THAT(refusal("1403636579763555584 0 0 1 0 0 0 1\n"), HasSubstr("(nanoseconds?)"));
  EXPECT_THAT(refusal("1403636579763555584.25 0 0 1 0 0 0 1\n"), HasSubstr("(nanoseconds?)"));
  EXPECT_THAT(refusal("num t x y z qx qy qz qw\n0 0.1 0 0 1 0 0 0 1\n"),
              HasSubstr("table.csv:2: 9 columns look like an index"));
  EXPECT_THAT(refusal("1 0 0 0 0 1 0 0 0 0 1 0\n.9 0 0 0 0 1 0 0 0 0 1 0\n"), HasSubstr("KITTI"));
  EXPECT_THAT(refusal("0 0 0 1 0.1 0.2 0.3\n"), HasSubstr("7 columns, must be 8"));
  EXPECT_THAT(refusal("0 0 0 1 0.1 0.2 0.3 0\n"), HasSubstr("must be t [s] x y z qx qy qz qw"));
  EXPECT_THAT(refusal(",time,x,y,z,qw,qx,qy,qz\n0,100000000,0,0,1,1,0,0,0\n"), HasSubstr("must be stamp [ns],x,y,z"));
  m_flight.write("mav0/cam0/data.csv", ",time,filename\n0,0,0000.png\n1,5,0000.png\n2,10,0000.png\n");
  EXPECT_REFUSED("data.csv:4: timestamp = 2 ns: looks like an index", AslSource(m_flight.path()));
}
