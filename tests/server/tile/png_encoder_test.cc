// SPDX-License-Identifier: Apache-2.0
#include "server/tile/png_encoder.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>
#include <png.h>

#include "core/base/random.h"

namespace loci {
namespace {

struct Rgba {
  int red = 0;
  int green = 0;
  int blue = 0;
  int alpha = 0;
  friend bool operator==(const Rgba&, const Rgba&) = default;
};

struct Picture {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::vector<Rgba> pixels;
};

// What libpng, which checks every checksum, makes of the bytes.
Picture Decode(const std::string& png) {
  png_image image = {};
  image.version = PNG_IMAGE_VERSION;
  EXPECT_NE(png_image_begin_read_from_memory(&image, png.data(), png.size()), 0) << image.message;
  image.format = PNG_FORMAT_RGBA;
  std::vector<std::uint8_t> bytes(PNG_IMAGE_SIZE(image));
  EXPECT_NE(png_image_finish_read(&image, nullptr, bytes.data(), 0, nullptr), 0) << image.message;
  EXPECT_EQ(image.warning_or_error, 0U) << image.message;
  Picture picture{image.width, image.height, {}};
  for (std::size_t i = 0; i + 3 < bytes.size(); i += 4) {
    picture.pixels.push_back({bytes[i], bytes[i + 1], bytes[i + 2], bytes[i + 3]});
  }
  return picture;
}

std::vector<LogOdds8> RandomPixels(RandomSequence& random, std::size_t count) {
  std::vector<LogOdds8> pixels;
  while (pixels.size() < count) {
    const auto value = random.NextBits() % 3 == 0
                           ? kUnobserved
                           : static_cast<LogOdds8>(static_cast<int>(random.NextBits() % 201) - 100);
    pixels.insert(pixels.end(), 1 + random.NextBits() % 20, value);
  }
  pixels.resize(count);
  return pixels;
}

TEST(PngEncoderTest, OccupancyIsGreyByProbabilityAndUnknownStandsApart) {
  std::vector<LogOdds8> pixels;
  for (int value = -128; value < 128; ++value) {
    pixels.push_back(static_cast<LogOdds8>(value));
  }
  const Picture picture = Decode(EncodePng(pixels, 16, 16, Layer::kOccupancy, PngStyle::kFull));
  ASSERT_EQ(picture.width, 16U);
  ASSERT_EQ(picture.height, 16U);
  EXPECT_EQ(picture.pixels[0], (Rgba{205, 205, 205, 255}));
  EXPECT_EQ(picture.pixels[128].red, 127);  // log-odds 0
  for (std::size_t i = 1; i < 256; ++i) {
    EXPECT_NE(picture.pixels[i].red, 205) << i;
    EXPECT_TRUE(i == 1 || picture.pixels[i].red <= picture.pixels[i - 1].red) << i;
  }
  EXPECT_GT(picture.pixels[28].red, 245);  // -100: free
  EXPECT_LT(picture.pixels[228].red, 10);  // +100: occupied
}

TEST(PngEncoderTest, TheMovingLayerIsRedAndTransparent) {
  const std::vector<LogOdds8> pixels = {kUnobserved, -50, 50, 100};
  const Picture picture = Decode(EncodePng(pixels, 2, 2, Layer::kMoving, PngStyle::kFull));
  EXPECT_EQ(picture.pixels[0].alpha, 0);
  EXPECT_EQ(picture.pixels[1].alpha, 0);
  EXPECT_GT(picture.pixels[2].alpha, 150);
  EXPECT_GT(picture.pixels[3].alpha, picture.pixels[2].alpha);
  EXPECT_GT(picture.pixels[3].red, 2 * picture.pixels[3].green);
}

TEST(PngEncoderTest, TriTellsUnknownFreeUndecidedAndOccupiedApart) {
  for (const std::uint32_t width : {1U, 3U, 4U, 6U, 257U}) {
    RandomSequence random(width);
    const std::vector<LogOdds8> pixels = RandomPixels(random, std::size_t{width} * 5);
    const Picture picture = Decode(EncodePng(pixels, width, 5, Layer::kOccupancy, PngStyle::kTri));
    ASSERT_EQ(picture.pixels.size(), pixels.size());
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const int expected = pixels[i] == kUnobserved ? 205
                           : pixels[i] <= -16       ? 254
                           : pixels[i] < 16         ? 160
                                                    : 0;
      ASSERT_EQ(picture.pixels[i], (Rgba{expected, expected, expected, 255}));
    }
  }
}

TEST(PngEncoderTest, ARegionIsTurnedSoThatItsFirstRowIsAtTheBottom) {
  const RasterImage image{2, 2, {100, 100, -100, -100}};
  const Picture picture = Decode(EncodePng(image, Layer::kOccupancy, PngStyle::kFull));
  EXPECT_GT(picture.pixels[0].red, 200);
  EXPECT_LT(picture.pixels[2].red, 50);
}

TEST(PngEncoderTest, LargeAndNoisyPicturesSurvive) {
  RandomSequence random(9);
  for (const std::uint32_t side : {256U, 1500U}) {
    std::vector<LogOdds8> pixels(std::size_t{side} * side);
    for (LogOdds8& pixel : pixels) {
      pixel = static_cast<LogOdds8>(random.NextBits());
    }
    for (const PngStyle style : {PngStyle::kFull, PngStyle::kTri}) {
      const Picture picture = Decode(EncodePng(pixels, side, side, Layer::kMoving, style));
      EXPECT_EQ(picture.pixels.size(), pixels.size());
    }
  }
}

TEST(PngEncoderTest, TheSameTileGivesTheSameBytes) {
  RandomSequence random(10);
  TileImage tile;
  const std::vector<LogOdds8> pixels = RandomPixels(random, tile.pixels.size());
  std::copy(pixels.begin(), pixels.end(), tile.pixels.begin());
  const std::string first = EncodePng(tile, Layer::kOccupancy, PngStyle::kFull);
  // Another picture in between, so that nothing is left in memory from the first.
  EncodePng(RandomPixels(random, 300 * 300), 300, 300, Layer::kMoving, PngStyle::kFull);
  EXPECT_EQ(EncodePng(tile, Layer::kOccupancy, PngStyle::kFull), first);
  EXPECT_LT(EncodePng(tile, Layer::kOccupancy, PngStyle::kTri).size(),
            EncodePng(tile, Layer::kOccupancy, PngStyle::kFull).size());
}

TEST(PngEncoderTest, StylesHaveNames) {
  EXPECT_EQ(PngStyleFromName(""), PngStyle::kFull);
  EXPECT_EQ(PngStyleFromName("full"), PngStyle::kFull);
  EXPECT_EQ(PngStyleFromName("tri"), PngStyle::kTri);
  EXPECT_EQ(PngStyleFromName("Tri"), std::nullopt);
}

}  // namespace
}  // namespace loci
