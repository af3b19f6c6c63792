// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/page.h"

#include <gmock/gmock.h>

using namespace bole;
using testing::HasSubstr;
using testing::Not;

TEST(Page, Base64IsThatOfTheStandard)
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

TEST(Page, EscapesItsTitleAndNeedsNoOtherFile)
{
  const std::string page = htmlPage("a <b> & c", htmlImage("x", "png", "a \"view\""), "let a = 1;\n");
  EXPECT_THAT(page, HasSubstr("<title>a &lt;b&gt; &amp; c</title>"));
  EXPECT_THAT(page, HasSubstr("alt=\"a &quot;view&quot;\" src=\"data:image/png;base64,eA==\""));
  EXPECT_THAT(page, HasSubstr("<script>\nlet a = 1;\n</script>"));
  EXPECT_THAT(page, Not(HasSubstr("http")));
}

TEST(Page, ATableHasItsRowsAndCells)
{
  EXPECT_THAT(htmlTable({"a", "b"}, {{"1", "2"}, {"3", "4"}}),
              HasSubstr("<tr><th>a</th><th>b</th></tr>\n<tr><td>1</td><td>2</td></tr>\n<tr><td>3</td><td>4</td></tr>"));
}
