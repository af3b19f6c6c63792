// SPDX-License-Identifier: GPL-2.0-or-later
#include "flight_folder.h"
#include "messages.h"

#include "input/csv_reader.h"
#include "input/recorded_source.h"
#include "input/trajectory.h"

#include <gmock/gmock.h>

using namespace bole;
using bole::test::FlightFolder;
using bole::test::messageOf;
using testing::ElementsAre;
using testing::HasSubstr;

namespace
{
class Tables : public testing::Test
{
protected:
  std::string write(const std::string &text) const
  {
    m_flight.write("table.csv", text);
    return m_flight.path() + "/table.csv";
  }
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
  EXPECT_THAT(messageOf([&] { rowsOf("1,\"a\n2,b\n3,c\n"); }), HasSubstr("table.csv:1: a quote is never closed"));
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
  EXPECT_THAT(messageOf([&] { AslSource(m_flight.path()); }), HasSubstr("data.csv:1: timestamp = \"x0\""));
}

TEST_F(Tables, TellWhatSeparatesTheirColumns)
{
  EXPECT_THAT(messageOf([&] { rowsOf("0\t1\n", {2}); }), HasSubstr("separated by tabs, must be by commas"));
  EXPECT_THAT(messageOf([&] { rowsOf("0 1\n", {2}); }), HasSubstr("separated by blanks, must be by commas"));
  EXPECT_THAT(messageOf([&] { rowsOf("0;1\n", {2}); }), HasSubstr("separated by semicolons, must be by commas"));
  EXPECT_THAT(messageOf([&] { rowsOf("0,1,2\n", {2, ' ', {}}); }), HasSubstr("by commas, must be by blanks"));
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
  EXPECT_THAT(messageOf([&] { AslSource(m_flight.path()); }),
              HasSubstr("data.csv:4: timestamp = 2 ns: looks like an index"));
}
