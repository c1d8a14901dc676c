// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/picture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <zlib.h>

#include "core/base/check.h"

namespace loci::cli {
namespace {

static_assert(sizeof(Colour) == 3, "pixels are handed to the encoder as they lie");

struct Glyph {
  char letter;
  std::array<std::string_view, 5> rows;
};
constexpr std::array<Glyph, 12> kGlyphs = {{{'0', {"###", "# #", "# #", "# #", "###"}},
                                            {'1', {" # ", "## ", " # ", " # ", "###"}},
                                            {'2', {"###", "  #", "###", "#  ", "###"}},
                                            {'3', {"###", "  #", "###", "  #", "###"}},
                                            {'4', {"# #", "# #", "###", "  #", "  #"}},
                                            {'5', {"###", "#  ", "###", "  #", "###"}},
                                            {'6', {"###", "#  ", "###", "# #", "###"}},
                                            {'7', {"###", "  #", "  #", "  #", "  #"}},
                                            {'8', {"###", "# #", "###", "# #", "###"}},
                                            {'9', {"###", "# #", "###", "  #", "###"}},
                                            {'.', {"   ", "   ", "   ", "   ", " # "}},
                                            {'m', {"   ", "   ", "###", "###", "# #"}}}};

// PNG specification (ISO 15948), section 5: numbers begin with the highest byte.
void AppendNumber(std::string& bytes, std::uint32_t number) {
  for (const unsigned shift : {24U, 16U, 8U, 0U}) {
    bytes += static_cast<char>(number >> shift & 0xFFU);
  }
}

// Length, type, data, and the checksum of type and data.
void AppendChunk(std::string& bytes, std::string_view type, std::string_view data) {
  AppendNumber(bytes, static_cast<std::uint32_t>(data.size()));
  const std::size_t begin = bytes.size();
  bytes.append(type).append(data);
  const auto* checked = reinterpret_cast<const Bytef*>(bytes.data() + begin);  // zlib's bytes
  AppendNumber(bytes, static_cast<std::uint32_t>(crc32_z(0, checked, bytes.size() - begin)));
}

}  // namespace

Picture::Picture(std::int32_t width, std::int32_t height, Colour colour)
    : width_(width),
      height_(height),
      pixels_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), colour) {}

void Picture::Set(std::int32_t x, std::int32_t y, Colour colour) {
  if (x >= 0 && y >= 0 && x < width_ && y < height_) {
    pixels_[Index(x, y)] = colour;
  }
}

void Picture::Blend(std::int32_t x, std::int32_t y, Colour colour, double alpha) {
  if (x < 0 || y < 0 || x >= width_ || y >= height_) {
    return;
  }
  Colour& pixel = pixels_[Index(x, y)];
  const auto mix = [alpha](std::uint8_t below, std::uint8_t above) {
    const double mixed =
        (1.0 - alpha) * static_cast<double>(below) + alpha * static_cast<double>(above);
    return static_cast<std::uint8_t>(std::lround(mixed));
  };
  pixel = {
      mix(pixel.red, colour.red), mix(pixel.green, colour.green), mix(pixel.blue, colour.blue)};
}

void Picture::DrawLine(Point from, Point to, double width_px, Colour colour, double alpha) {
  const double dx = to.x - from.x;
  const double dy = to.y - from.y;
  const double length2 = dx * dx + dy * dy;
  const double reach = 0.5 * width_px + 1.0;
  const auto clamp = [](double value, std::int32_t high) {
    return static_cast<std::int32_t>(std::clamp(value, 0.0, static_cast<double>(high)));
  };
  const std::int32_t y_begin = clamp(std::min(from.y, to.y) - reach, height_);
  const std::int32_t y_end = clamp(std::max(from.y, to.y) + reach + 1.0, height_);
  for (std::int32_t y = y_begin; y < y_end; ++y) {
    // The part of the line that can touch this row.
    double t_low = 0.0;
    double t_high = 1.0;
    if (std::abs(dy) > 1e-9) {
      const double t1 = (static_cast<double>(y) - reach - from.y) / dy;
      const double t2 = (static_cast<double>(y) + 1.0 + reach - from.y) / dy;
      t_low = std::clamp(std::min(t1, t2), 0.0, 1.0);
      t_high = std::clamp(std::max(t1, t2), 0.0, 1.0);
    }
    const double x1 = from.x + t_low * dx;
    const double x2 = from.x + t_high * dx;
    const std::int32_t x_begin = clamp(std::min(x1, x2) - reach, width_);
    const std::int32_t x_end = clamp(std::max(x1, x2) + reach + 1.0, width_);
    for (std::int32_t x = x_begin; x < x_end; ++x) {
      const double px = static_cast<double>(x) + 0.5 - from.x;
      const double py = static_cast<double>(y) + 0.5 - from.y;
      const double t = length2 > 0.0 ? std::clamp((px * dx + py * dy) / length2, 0.0, 1.0) : 0.0;
      const double distance = std::hypot(px - t * dx, py - t * dy);
      const double cover = std::clamp(0.5 * width_px + 0.5 - distance, 0.0, 1.0);
      if (cover > 0.0) {
        Blend(x, y, colour, cover * alpha);
      }
    }
  }
}

void Picture::FillBox(
    std::int32_t x, std::int32_t y, std::int32_t width, std::int32_t height, Colour colour) {
  for (std::int32_t row = y; row < y + height; ++row) {
    for (std::int32_t column = x; column < x + width; ++column) {
      Set(column, row, colour);
    }
  }
}

void Picture::DrawText(
    std::int32_t x, std::int32_t y, std::int32_t dot_px, std::string_view text, Colour colour) {
  for (const char letter : text) {
    const auto glyph = std::find_if(
        kGlyphs.begin(), kGlyphs.end(), [letter](const Glyph& g) { return g.letter == letter; });
    for (std::int32_t dot = 0; glyph != kGlyphs.end() && dot < 15; ++dot) {
      const std::int32_t row = dot / 3;
      const std::int32_t column = dot % 3;
      if (glyph->rows[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)] == '#') {
        FillBox(x + column * dot_px, y + row * dot_px, dot_px, dot_px, colour);
      }
    }
    x += 4 * dot_px;
  }
}

std::string Picture::EncodePng() const {
  std::string rows;
  const std::size_t row_bytes = static_cast<std::size_t>(width_) * sizeof(Colour);
  rows.reserve((row_bytes + 1) * static_cast<std::size_t>(height_));
  for (std::int32_t y = 0; y < height_; ++y) {
    rows += '\0';  // no filter
    rows.append(reinterpret_cast<const char*>(&pixels_[Index(0, y)]), row_bytes);
  }
  uLongf size = compressBound(static_cast<uLong>(rows.size()));
  std::string packed(size, '\0');
  constexpr int kLevel = 4;  // twice as fast as the default, pictures of maps grow by little
  const int result = compress2(reinterpret_cast<Bytef*>(packed.data()),
                               &size,
                               reinterpret_cast<const Bytef*>(rows.data()),
                               static_cast<uLong>(rows.size()),
                               kLevel);
  LOCI_CHECK(result == Z_OK);  // the room is as large as zlib asks for
  packed.resize(size);
  std::string header;
  AppendNumber(header, static_cast<std::uint32_t>(width_));
  AppendNumber(header, static_cast<std::uint32_t>(height_));
  header += std::string("\x08\x02\x00\x00\x00", 5);  // 8 bits a channel, red green blue
  std::string png = "\x89PNG\r\n\x1a\n";
  AppendChunk(png, "IHDR", header);
  AppendChunk(png, "IDAT", packed);
  AppendChunk(png, "IEND", "");
  return png;
}

}  // namespace loci::cli
