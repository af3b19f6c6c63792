// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/user_text.h"

#include <gtest/gtest.h>

namespace
{
using bole::withoutSecrets;

TEST(Secrets, NamesAndPasswordsLeaveAddresses)
{
  EXPECT_EQ(withoutSecrets("http://user:secret@host:80/a.mjpg"), "http://host:80/a.mjpg");
  EXPECT_EQ(withoutSecrets("rtsp://user@host"), "rtsp://host");
  EXPECT_EQ(withoutSecrets("rtsp://:secret@[::1]:554/1"), "rtsp://[::1]:554/1");
  EXPECT_EQ(withoutSecrets("http://user:s@e:c@ret@host/x"), "http://host/x");
  EXPECT_EQ(withoutSecrets("http://user:sec/ret?#@host/x"), "http://host/x");
  EXPECT_EQ(withoutSecrets("http://u:secret@a/1: no video, nor at http://u:secret@b/2: it is closed"),
            "http://a/1: no video, nor at http://b/2: it is closed");
}

TEST(Secrets, WhatAQueryCallsASecretIsNotShown)
{
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
} // namespace
