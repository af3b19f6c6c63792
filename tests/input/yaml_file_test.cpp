// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/yaml_file.h"

#include <bole/open_source.h>

#include <gmock/gmock.h>

#include <fstream>
#include <string>
#include <unistd.h>
#include <visp3/core/vpException.h>

namespace
{
using namespace bole;
using testing::HasSubstr;

std::string messageOf(const std::string &text)
{
  const std::string path = testing::TempDir() + std::to_string(getpid()) + "_yaml_file_test.yaml";
  std::ofstream(path, std::ios::binary) << text;
  try {
    loadYaml(path);
  }
  catch (const vpException &error) {
    const std::string message = error.getStringMessage();
    try {
      readCamera(path);
      ADD_FAILURE() << "a camera file is read by the same loader";
    }
    catch (const vpException &camera) {
      EXPECT_EQ(camera.getStringMessage(), message);
    }
    return message;
  }
  return "";
}

std::string repeated(const std::string &text, int count)
{
  std::string all;
  for (int i = 0; i < count; ++i)
    all += text;
  return all;
}

TEST(YamlFile, AnAliasThatHoldsItselfIsRefused)
{
  EXPECT_THAT(messageOf("a: 1\nb: &b [1, *b]\n"), HasSubstr("yaml_file_test.yaml:2: is nested deeper"));
  EXPECT_THAT(messageOf("a: &a\n  b: *a\n"), HasSubstr("holds itself by an alias"));
  EXPECT_THAT(messageOf("&a {b: &b {a: *a, b: *b}, c: *a}\n"), HasSubstr("by an alias"));
}

TEST(YamlFile, AliasesThatMultiplyAreRefused)
{
  std::string bomb = "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]\n";
  for (int i = 1; i < 12; ++i) {
    const std::string before = "*a" + std::to_string(i - 1);
    bomb += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [" + before + repeated(", " + before, 8) + "]\n";
  }
  EXPECT_THAT(messageOf(bomb), testing::MatchesRegex(".*yaml_file_test.yaml:[0-9]+: aliases make more than.*"));
}

TEST(YamlFile, DeepNestingIsRefused)
{
  EXPECT_THAT(messageOf("a: 1\nb: " + repeated("[", 200000) + "\n"), HasSubstr(":2: is nested deeper than 32"));
  EXPECT_THAT(messageOf("a: " + repeated("{a: ", 100) + "\n"), HasSubstr(":1: is nested deeper than 32"));
  std::string indented;
  for (int depth = 0; depth < 400; ++depth)
    indented += std::string(static_cast<std::size_t>(depth), ' ') + "a:\n";
  EXPECT_THAT(messageOf(indented), HasSubstr("is nested deeper than 32"));
  EXPECT_THAT(messageOf(repeated("- ", 100000) + "1\n"), HasSubstr("yaml_file_test.yaml:1: "));
  EXPECT_THAT(messageOf(repeated("? ", 100000) + "1\n"), HasSubstr("yaml_file_test.yaml:1: "));
}

TEST(YamlFile, OtherEncodingsAreRefusedAndTheMarkOfUtf8IsNot)
{
  EXPECT_EQ(messageOf("\xEF\xBB\xBF"
                      "a: 1\n"),
            "");
  EXPECT_THAT(messageOf("\xFF\xFE"
                        "a\0:\0"),
              HasSubstr("yaml_file_test.yaml:1: is no text in UTF-8"));
  EXPECT_THAT(messageOf(std::string("a: 1\nb: \0\n", 10)), HasSubstr(":2: is no text in UTF-8"));
}

TEST(YamlFile, NamesTheLineOfAMistake)
{
  EXPECT_THAT(messageOf("a: 1\nb: [1, 2\nc: 3\n"), testing::MatchesRegex(".*yaml_file_test.yaml:[0-9]+: .*"));
  EXPECT_THAT(messageOf("a: 1\n? [1, 2]\n: 3\n"), HasSubstr(":2: a key must be one word"));
  EXPECT_THAT(messageOf("a: *nowhere\n"), HasSubstr("yaml_file_test.yaml:1: "));
  EXPECT_THAT(messageOf("a: 1\n" + std::string(2000000, ' ')), HasSubstr("must be at most 1000000"));
}

TEST(YamlFile, AliasesThatDoNoHarmAreRead) { EXPECT_EQ(messageOf("a: &a [1, 2]\nb: *a\nc: [*a, *a]\n"), ""); }
} // namespace
