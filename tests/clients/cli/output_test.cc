// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include "clients/cli/json_output.h"
#include "clients/cli/picture.h"
#include "clients/cli/progress_bar.h"
#include "clients/cli/text_output.h"
#include "loci/v1/map_admin.pb.h"
#include "tests/support/matchers.h"

namespace loci::cli {
namespace {

TEST(JsonWriterTest, PutsCommasAndEscapesWhereTheyBelong) {
  JsonWriter json;
  json.BeginObject().Key("a").BeginArray().Value(1.5).Value("x\"\\\n").Value(true).EndArray();
  json.Key("b").BeginObject().EndObject().Key("c").Value(std::uint64_t{18446744073709551615U});
  json.Key("d").Value(std::numeric_limits<double>::quiet_NaN()).EndObject();
  EXPECT_EQ(json.text(),
            R"({"a":[1.5,"x\"\\\u000a",true],"b":{},"c":18446744073709551615,"d":null})");
}

TEST(JsonWriterTest, WritesAllFieldsOfAMessageWithNumbersAsNumbers) {
  v1::MapInfo info;
  info.set_map("office");
  info.set_revision(12);
  JsonWriter json;
  json.Value(info);
  EXPECT_THAT(json.text(), testing::HasSubstr(R"("map":"office","revision":12,"last_event":0)"));
  EXPECT_THAT(json.text(), testing::HasSubstr(R"("closures":0)"));
}

TEST(TextOutputTest, WritesStampsToTheNanosecond) {
  EXPECT_EQ(StampText(976052857337530123), "976052857.337530123");
  EXPECT_EQ(StampText(5), "0.000000005");
  EXPECT_EQ(StampText(-1'500'000'000), "-1.500000000");
}

TEST(TextOutputTest, NamesAFileThatCannotBeWritten) {
  EXPECT_THAT(WriteFile("/nowhere/x.txt", "x"),
              IsStatus(StatusCode::kInvalidArgument, "/nowhere/x.txt"));
}

TEST(ProgressBarTest, IsSilentWhenNobodyWatchesButStillReports) {
  std::ostringstream out;
  {
    ProgressBar bar(out, false, "office");
    bar.Show(1, 2, "half");
    bar.Print("trouble");
  }
  EXPECT_EQ(out.str(), "trouble\n");
  std::ostringstream watched;
  ProgressBar(watched, true, "office").Show(1, 2, "half");
  EXPECT_THAT(watched.str(), testing::HasSubstr("50 %"));
}

TEST(PictureTest, DrawsInsideAndCutsOffOutside) {
  Picture picture(20, 10, {255, 255, 255});
  picture.DrawLine({-5.0, 5.0}, {100.0, 5.0}, 2.0, {0, 0, 0});
  EXPECT_EQ(picture.at(0, 4), (Colour{0, 0, 0}));
  EXPECT_EQ(picture.at(19, 5), (Colour{0, 0, 0}));
  EXPECT_EQ(picture.at(10, 0), (Colour{255, 255, 255}));
  picture.DrawText(18, 8, 3, "40m", {9, 9, 9});
  picture.FillBox(-3, -3, 4, 4, {1, 2, 3});
  EXPECT_EQ(picture.at(0, 0), (Colour{1, 2, 3}));
}

TEST(PictureTest, EncodesAPngWithTheSamePixels) {
  Picture picture(3, 2, {10, 20, 30});
  picture.Set(2, 1, {40, 50, 60});
  const std::string png = picture.EncodePng();
  ASSERT_EQ(png.substr(0, 8), "\x89PNG\r\n\x1a\n");
  EXPECT_EQ(png.substr(12, 12), std::string("IHDR\0\0\0\3\0\0\0\2", 12));
  const std::size_t data = png.find("IDAT") + 4;
  std::string rows(20, '\0');
  uLongf size = rows.size();
  ASSERT_EQ(uncompress(reinterpret_cast<Bytef*>(rows.data()),
                       &size,
                       reinterpret_cast<const Bytef*>(png.data() + data),
                       static_cast<uLong>(png.size() - data)),
            Z_OK);
  EXPECT_EQ(rows, std::string("\0\12\24\36\12\24\36\12\24\36\0\12\24\36\12\24\36\50\62\74", 20));
}

}  // namespace
}  // namespace loci::cli
