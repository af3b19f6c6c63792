// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/address.h"
#include "ardrone/at_command.h"
#include "emulator/wire_format.h"

#include <bole/visp.h>
#include <gtest/gtest.h>
#include <visp3/core/vpException.h>

using namespace bole;

TEST(AtCommand, WritesFloatsAsTheDeveloperGuideDoes)
{
  EXPECT_EQ(atFloat(-0.8f), "-1085485875");
  EXPECT_EQ(atFloat(0), "0");
  EXPECT_EQ(atFloat(0.75f), "1061158912");
}

TEST(AtCommand, ReadsSeveralCommandsOfADatagram)
{
  const auto commands = parseAtCommands("AT*PCMD=21625,1,0,0,0,0\rAT*REF=21626,290717696\rrubbish\rAT*CONFIG=3,"
                                        "\"general:navdata_demo\",\"FALSE\"\r");
  ASSERT_EQ(commands.size(), 3u);
  EXPECT_EQ(commands[0].name, "PCMD");
  EXPECT_EQ(commands[0].sequence, 21625);
  EXPECT_EQ(commands[0].arguments.size(), 5u);
  EXPECT_EQ(commands[1].arguments[0], "290717696");
  EXPECT_EQ(commands[2].arguments[0], "general:navdata_demo");
  EXPECT_EQ(commands[2].arguments[1], "FALSE");
}

TEST(ArDroneAddress, ReadsHostPortsAndOptions)
{
  const auto plain = ArDroneAddress::parse("ardrone://");
  EXPECT_EQ(plain.host, "192.168.1.1");
  EXPECT_EQ(plain.video_port, 5555);
  const auto address =
      ArDroneAddress::parse("ardrone://127.0.0.1?offset=10000&at=7000&generation=1&camera=a/b.yaml&video_delay_ms=10");
  EXPECT_EQ(address.host, "127.0.0.1");
  EXPECT_EQ(address.navdata_port, 15554);
  EXPECT_EQ(address.video_port, 15555);
  EXPECT_EQ(address.at_port, 17000);
  EXPECT_EQ(address.generation, 1);
  EXPECT_EQ(address.camera_path, "a/b.yaml");
  EXPECT_DOUBLE_EQ(address.video_delay_s, 0.01);
  const auto again = ArDroneAddress::parse(address.toString());
  EXPECT_EQ(again.at_port, 17000);
  EXPECT_EQ(again.camera_path, "a/b.yaml");
}

TEST(ArDroneAddress, SaysWhatIsWrong)
{
  for (const char *wrong :
       {"ardrone://host:5555", "ardrone://h?video=70000", "ardrone://h?offset=x", "ardrone://h?generation=3",
        "ardrone://h?color=red", "tcp://h", "ardrone://h?video=60000&offset=59000"}) {
    try {
      ArDroneAddress::parse(wrong);
      ADD_FAILURE() << wrong;
    }
    catch (const vpException &error) {
      EXPECT_NE(std::string(error.what()).find("must"), std::string::npos) << error.what();
    }
  }
}
