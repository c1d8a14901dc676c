// SPDX-License-Identifier: Apache-2.0
// A colour picture to draw into, and its PNG.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace loci::cli {

struct Colour {
  std::uint8_t red = 0;
  std::uint8_t green = 0;
  std::uint8_t blue = 0;

  friend bool operator==(const Colour&, const Colour&) = default;
};

// Pixel (0, 0) is the upper left one. What is drawn outside is cut off.
class Picture {
 public:
  Picture(std::int32_t width, std::int32_t height, Colour colour);

  std::int32_t width() const { return width_; }
  std::int32_t height() const { return height_; }
  // The pixel must lie inside.
  Colour at(std::int32_t x, std::int32_t y) const { return pixels_[Index(x, y)]; }

  void Set(std::int32_t x, std::int32_t y, Colour colour);
  // `alpha` in [0, 1]: how much of the colour covers what was there.
  void Blend(std::int32_t x, std::int32_t y, Colour colour, double alpha);
  // A line with soft borders, `width_px` wide; coordinates in pixels, a pixel's centre at + 0.5.
  struct Point {
    double x = 0.0;
    double y = 0.0;
  };
  void DrawLine(Point from, Point to, double width_px, Colour colour, double alpha = 1.0);
  void FillBox(
      std::int32_t x, std::int32_t y, std::int32_t width, std::int32_t height, Colour colour);
  // Digits, "." and "m", 3 x 5 dots of `dot_px` pixels a letter; (x, y) is the upper left corner.
  void DrawText(
      std::int32_t x, std::int32_t y, std::int32_t dot_px, std::string_view text, Colour colour);

  // 24 bit, fast deflate, no filters (they hurt pictures of few colours).
  std::string EncodePng() const;

 private:
  std::size_t Index(std::int32_t x, std::int32_t y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }

  std::int32_t width_;
  std::int32_t height_;
  std::vector<Colour> pixels_;
};

}  // namespace loci::cli
