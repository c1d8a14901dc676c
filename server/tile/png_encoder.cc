// SPDX-License-Identifier: Apache-2.0
#include "server/tile/png_encoder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include <isa-l/crc.h>
#include <isa-l/igzip_lib.h>

#include "core/base/check.h"

namespace loci {
namespace {

// Pixels of one picture: deflate counts its input in 32 bits.
constexpr std::uint64_t kPixelCountMax = 1ULL << 30U;

// Colour types and their depths (PNG specification, 11.2.2).
constexpr std::uint8_t kGrey = 0;
constexpr std::uint8_t kPalette = 3;

struct Colour {
  std::uint8_t red = 0;
  std::uint8_t green = 0;
  std::uint8_t blue = 0;
  std::uint8_t alpha = 255;
};

std::size_t IndexOf(LogOdds8 pixel) {
  return static_cast<std::size_t>(pixel + 128);
}

double ProbabilityOf(LogOdds8 pixel) {
  return 1.0 / (1.0 + std::exp(-kLogOddsPerUnit * static_cast<double>(pixel)));
}

// map_server's convention: 254 free, 0 occupied, 205 unknown and nothing else.
constexpr std::uint8_t kUnknownGrey = 205;

std::array<std::uint8_t, 256> MakeGreys() {
  std::array<std::uint8_t, 256> greys{};
  for (int value = -128; value < 128; ++value) {
    const auto pixel = static_cast<LogOdds8>(value);
    auto grey = static_cast<std::uint8_t>(std::lround(254.0 * (1.0 - ProbabilityOf(pixel))));
    if (grey == kUnknownGrey) {
      ++grey;
    }
    greys[IndexOf(pixel)] = pixel == kUnobserved ? kUnknownGrey : grey;
  }
  return greys;
}

// Red, the more opaque the surer that something moved.
std::vector<Colour> MakeMovingPalette() {
  std::vector<Colour> palette(256);
  for (int value = -128; value < 128; ++value) {
    const auto pixel = static_cast<LogOdds8>(value);
    const double certainty = std::max(0.0, 2.0 * ProbabilityOf(pixel) - 1.0);
    const auto alpha =
        pixel == kUnobserved ? 0 : static_cast<std::uint8_t>(std::lround(255.0 * certainty));
    palette[IndexOf(pixel)] = {214, 39, 40, static_cast<std::uint8_t>(alpha)};
  }
  return palette;
}

// Undecided: a probability from 0.35 to 0.65.
constexpr LogOdds8 kDecided = 16;

std::array<std::uint8_t, 256> MakeTriIndices() {
  std::array<std::uint8_t, 256> indices{};
  for (int value = -128; value < 128; ++value) {
    const auto pixel = static_cast<LogOdds8>(value);
    indices[IndexOf(pixel)] = pixel == kUnobserved ? 0
                              : pixel <= -kDecided ? 1
                              : pixel < kDecided   ? 2
                                                   : 3;
  }
  return indices;
}

std::vector<Colour> TriPalette(Layer layer) {
  if (layer == Layer::kOccupancy) {
    return {
        {kUnknownGrey, kUnknownGrey, kUnknownGrey}, {254, 254, 254}, {160, 160, 160}, {0, 0, 0}};
  }
  return {{255, 255, 255, 0}, {255, 255, 255, 0}, {214, 39, 40, 64}, {214, 39, 40}};
}

// Memory that deflate works in, a third of a megabyte: each thread keeps its own.
struct DeflateMemory {
  isal_zstream stream;
  std::array<std::uint8_t, ISAL_DEF_LVL1_DEFAULT> level_buffer;
  std::vector<std::uint8_t> rows;
  std::vector<std::uint8_t> packed;
};

DeflateMemory& MemoryOfThread() {
  static thread_local const auto memory = std::make_unique<DeflateMemory>();
  return *memory;
}

class PngWriter {
 public:
  PngWriter() : bytes_("\x89PNG\r\n\x1A\n") {}

  void AddHeader(std::uint32_t width, std::uint32_t height, std::uint8_t depth, std::uint8_t type) {
    std::string data;
    AppendWord(width, data);
    AppendWord(height, data);
    data += {static_cast<char>(depth), static_cast<char>(type), 0, 0, 0};
    AddChunk("IHDR", data);
  }

  void AddPalette(const std::vector<Colour>& palette) {
    std::string colours;
    std::string alphas;
    for (const Colour& colour : palette) {
      colours += {static_cast<char>(colour.red),
                  static_cast<char>(colour.green),
                  static_cast<char>(colour.blue)};
      alphas += static_cast<char>(colour.alpha);
    }
    AddChunk("PLTE", colours);
    AddChunk("tRNS", alphas);
  }

  // Each of memory.rows begins with its filter.
  void AddRows(DeflateMemory& memory) {
    // Should deflate fail to compress, it stores blocks of up to 65535 bytes with 5 bytes each.
    memory.packed.resize(memory.rows.size() + memory.rows.size() / 1024 + 512);
    isal_zstream& stream = memory.stream;
    isal_deflate_stateless_init(&stream);
    stream.level = 1;
    stream.level_buf = memory.level_buffer.data();
    stream.level_buf_size = static_cast<std::uint32_t>(memory.level_buffer.size());
    stream.gzip_flag = IGZIP_ZLIB;
    stream.end_of_stream = 1;
    stream.next_in = memory.rows.data();
    stream.avail_in = static_cast<std::uint32_t>(memory.rows.size());
    stream.next_out = memory.packed.data();
    stream.avail_out = static_cast<std::uint32_t>(memory.packed.size());
    LOCI_CHECK(isal_deflate_stateless(&stream) == COMP_OK);
    AddChunk("IDAT", {reinterpret_cast<const char*>(memory.packed.data()), stream.total_out});
  }

  // A large picture leaves no large memory behind.
  static void GiveBack(DeflateMemory& memory) {
    constexpr std::size_t kKeptBytes = 1U << 20U;
    if (memory.rows.size() > kKeptBytes) {
      memory.rows = {};
      memory.packed = {};
    }
  }

  std::string Finish() {
    AddChunk("IEND", "");
    return std::move(bytes_);
  }

 private:
  static void AppendWord(std::uint32_t word, std::string& to) {  // big-endian
    for (int shift = 24; shift >= 0; shift -= 8) {
      to += static_cast<char>(word >> static_cast<unsigned>(shift));
    }
  }

  void AddChunk(std::string_view type, std::string_view data) {
    AppendWord(static_cast<std::uint32_t>(data.size()), bytes_);
    const std::size_t begin = bytes_.size();
    bytes_ += type;
    bytes_ += data;
    // The checksum covers type and data.
    AppendWord(crc32_gzip_refl(0,
                               reinterpret_cast<const unsigned char*>(bytes_.data()) + begin,
                               bytes_.size() - begin),
               bytes_);
  }

  std::string bytes_;
};

std::string EncodeBytes(std::span<const LogOdds8> pixels,
                        std::uint32_t width,
                        std::uint32_t height,
                        Layer layer) {
  static const std::array<std::uint8_t, 256> greys = MakeGreys();
  static const std::vector<Colour> moving_palette = MakeMovingPalette();
  const bool is_grey = layer == Layer::kOccupancy;
  DeflateMemory& memory = MemoryOfThread();
  memory.rows.resize((std::size_t{width} + 1) * height);
  std::uint8_t* to = memory.rows.data();
  const LogOdds8* from = pixels.data();
  for (std::uint32_t row = 0; row < height; ++row) {
    *to++ = 0;  // no filter
    for (std::uint32_t column = 0; column < width; ++column, ++from) {
      *to++ = is_grey ? greys[IndexOf(*from)] : static_cast<std::uint8_t>(IndexOf(*from));
    }
  }
  PngWriter writer;
  writer.AddHeader(width, height, 8, is_grey ? kGrey : kPalette);
  if (!is_grey) {
    writer.AddPalette(moving_palette);
  }
  writer.AddRows(memory);
  PngWriter::GiveBack(memory);
  return writer.Finish();
}

std::string EncodeTri(std::span<const LogOdds8> pixels,
                      std::uint32_t width,
                      std::uint32_t height,
                      Layer layer) {
  static const std::array<std::uint8_t, 256> indices = MakeTriIndices();
  const std::size_t row_size_bytes = (std::size_t{width} + 3) / 4 + 1;
  DeflateMemory& memory = MemoryOfThread();
  memory.rows.resize(row_size_bytes * height);
  for (std::uint32_t row = 0; row < height; ++row) {
    std::uint8_t* to = memory.rows.data() + row_size_bytes * row;
    const LogOdds8* from = pixels.data() + std::size_t{width} * row;
    *to++ = 0;  // no filter
    // Four pixels in a byte, the leftmost in the highest bits; a row begins with a new byte.
    for (std::uint32_t column = 0; column < width; column += 4) {
      unsigned byte = 0;
      for (std::uint32_t i = column; i < column + 4; ++i) {
        byte = byte << 2U | (i < width ? indices[IndexOf(from[i])] : 0U);
      }
      *to++ = static_cast<std::uint8_t>(byte);
    }
  }
  PngWriter writer;
  writer.AddHeader(width, height, 2, kPalette);
  writer.AddPalette(TriPalette(layer));
  writer.AddRows(memory);
  PngWriter::GiveBack(memory);
  return writer.Finish();
}

}  // namespace

std::optional<PngStyle> PngStyleFromName(std::string_view name) {
  if (name.empty() || name == "full") {
    return PngStyle::kFull;
  }
  return name == "tri" ? std::optional(PngStyle::kTri) : std::nullopt;
}

std::string EncodePng(std::span<const LogOdds8> pixels,
                      std::uint32_t width,
                      std::uint32_t height,
                      Layer layer,
                      PngStyle style) {
  LOCI_CHECK(width >= 1 && height >= 1);
  LOCI_CHECK(pixels.size() == std::uint64_t{width} * height && pixels.size() <= kPixelCountMax);
  return style == PngStyle::kTri ? EncodeTri(pixels, width, height, layer)
                                 : EncodeBytes(pixels, width, height, layer);
}

std::string EncodePng(const TileImage& tile, Layer layer, PngStyle style) {
  return EncodePng(tile.pixels, kTileSide, kTileSide, layer, style);
}

std::string EncodePng(const RasterImage& image, Layer layer, PngStyle style) {
  const auto width = static_cast<std::uint32_t>(image.width);
  const auto height = static_cast<std::uint32_t>(image.height);
  std::vector<LogOdds8> turned;
  turned.reserve(image.pixels.size());
  for (std::uint32_t row = height; row-- > 0;) {
    const auto begin = image.pixels.begin() + static_cast<std::ptrdiff_t>(std::size_t{width} * row);
    turned.insert(turned.end(), begin, begin + width);
  }
  return EncodePng(turned, width, height, layer, style);
}

}  // namespace loci
