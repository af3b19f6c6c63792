// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/base64.h"

#include <gtest/gtest.h>

using namespace bole;

TEST(Base64, IsThatOfTheStandard)
{
  // RFC 4648, section 10
  for (const auto &[bytes, text] : std::vector<std::pair<std::string, std::string>>{{"", ""},
                                                                                    {"f", "Zg=="},
                                                                                    {"fo", "Zm8="},
                                                                                    {"foo", "Zm9v"},
                                                                                    {"foob", "Zm9vYg=="},
                                                                                    {"fooba", "Zm9vYmE="},
                                                                                    {"foobar", "Zm9vYmFy"}})
    EXPECT_EQ(base64(bytes), text);
  EXPECT_EQ(base64(std::string("\xff\xfe\x00", 3)), "//4A");
}
