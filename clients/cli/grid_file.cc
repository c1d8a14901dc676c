// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/grid_file.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>

#include "clients/cli/text_output.h"

namespace loci {
namespace {

// What map_server writes, and what nav2 reads as occupied, free and unknown with the thresholds
// below: 205 is (255 - 205) / 255 = 0.19608, just above the threshold for free.
constexpr unsigned char kOccupiedGrey = 0;
constexpr unsigned char kFreeGrey = 254;
constexpr unsigned char kUnknownGrey = 205;
constexpr std::string_view kThresholds = "occupied_thresh: 0.65\nfree_thresh: 0.196\n";
constexpr std::int32_t kSideMax = 1 << 20;

char GreyOf(OccupancyMap::Cell cell) {
  switch (cell) {
    case OccupancyMap::Cell::kFree:
      return static_cast<char>(kFreeGrey);
    case OccupancyMap::Cell::kOccupied:
      return static_cast<char>(kOccupiedGrey);
    case OccupancyMap::Cell::kUnknown:
      break;
  }
  return static_cast<char>(kUnknownGrey);
}

StatusOr<std::string> ReadFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    return NotFoundError(path + ": cannot be read");
  }
  return std::string(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
}

StatusOr<double> NumberIn(const std::string& path, const std::string& field, std::string text) {
  const std::size_t begin = text.find_first_not_of(" \t[\"'");
  text.erase(0, begin == std::string::npos ? text.size() : begin);
  double value = 0.0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc()) {
    return InvalidArgumentError(path + ": " + field + ": \"" + text + "\", must be a number");
  }
  return value;
}

// "key: value" lines: all of YAML that these files use.
std::map<std::string, std::string> KeysOf(const std::string& yaml) {
  std::map<std::string, std::string> keys;
  std::istringstream lines(yaml);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t colon = line.find(':');
    if (colon == std::string::npos || line.front() == '#') {
      continue;
    }
    std::string value = line.substr(colon + 1);
    const std::size_t begin = value.find_first_not_of(" \t");
    const std::size_t end = value.find_last_not_of(" \t\r");
    keys[line.substr(0, colon)] =
        begin == std::string::npos ? "" : value.substr(begin, end - begin + 1);
  }
  return keys;
}

struct Picture {
  std::int32_t width = 0;
  std::int32_t height = 0;
  double grey_max = 255.0;
  std::string_view pixels;  // top row first
};

StatusOr<Picture> ParsePgm(const std::string& path, std::string_view bytes) {
  const Status problem = InvalidArgumentError(path + ": must be a binary PGM picture (P5)");
  if (!bytes.starts_with("P5")) {
    return problem;
  }
  std::size_t position = 2;
  std::int32_t numbers[3] = {};
  for (std::int32_t& number : numbers) {
    while (position < bytes.size() &&
           (std::isspace(static_cast<unsigned char>(bytes[position])) != 0 ||
            bytes[position] == '#')) {
      position = bytes[position] == '#' ? std::min(bytes.find('\n', position), bytes.size())
                                        : position + 1;
    }
    const auto [stop, error] =
        std::from_chars(bytes.data() + position, bytes.data() + bytes.size(), number);
    if (error != std::errc() || number < 1 || number > kSideMax) {
      return problem;
    }
    position = static_cast<std::size_t>(stop - bytes.data());
  }
  const auto size = static_cast<std::size_t>(numbers[0]) * static_cast<std::size_t>(numbers[1]);
  if (numbers[2] > 255 || position >= bytes.size() || bytes.size() - position - 1 < size) {
    return problem;
  }
  return Picture{
      numbers[0], numbers[1], static_cast<double>(numbers[2]), bytes.substr(position + 1, size)};
}

struct Thresholds {
  double occupied = 0.65;
  double free = 0.196;
  bool negate = false;
};

OccupancyMap::Cell CellOf(char grey, double grey_max, const Thresholds& thresholds) {
  const double share = static_cast<double>(static_cast<unsigned char>(grey)) / grey_max;
  const double occupied = thresholds.negate ? share : 1.0 - share;
  if (occupied > thresholds.occupied) {
    return OccupancyMap::Cell::kOccupied;
  }
  return occupied < thresholds.free ? OccupancyMap::Cell::kFree : OccupancyMap::Cell::kUnknown;
}

}  // namespace

Status WriteGridFile(const std::string& path, const OccupancyMap& map) {
  std::filesystem::path base(path);
  if (base.extension() == ".yaml" || base.extension() == ".yml" || base.extension() == ".pgm") {
    base.replace_extension();
  }
  std::string picture =
      "P5\n" + std::to_string(map.width) + ' ' + std::to_string(map.height) + "\n255\n";
  for (std::int32_t row = map.height - 1; row >= 0; --row) {
    for (std::int32_t column = 0; column < map.width; ++column) {
      picture += GreyOf(map.at(column, row));
    }
  }
  const std::string yaml = "image: " + base.filename().string() +
                           ".pgm\nmode: trinary\nresolution: " + cli::NumberText(map.resolution_m) +
                           "\norigin: [" + cli::NumberText(map.x_min_m) + ", " +
                           cli::NumberText(map.y_min_m) + ", 0.0]\nnegate: 0\n" +
                           std::string(kThresholds);
  LOCI_RETURN_IF_ERROR(cli::WriteFile(base.string() + ".pgm", picture));
  return cli::WriteFile(base.string() + ".yaml", yaml);
}

StatusOr<OccupancyMap> ReadGridFile(const std::string& yaml_path) {
  LOCI_ASSIGN_OR_RETURN(const std::string yaml, ReadFile(yaml_path));
  std::map<std::string, std::string> keys = KeysOf(yaml);
  for (const char* key : {"image", "resolution", "origin"}) {
    if (keys[key].empty()) {
      return InvalidArgumentError(yaml_path + ": " + key + " is missing");
    }
  }
  OccupancyMap map;
  LOCI_ASSIGN_OR_RETURN(map.resolution_m, NumberIn(yaml_path, "resolution", keys["resolution"]));
  if (!(map.resolution_m > 0.0)) {
    return InvalidArgumentError(yaml_path + ": resolution: " + keys["resolution"] +
                                ", must be above 0");
  }
  const std::string& origin = keys["origin"];
  const std::size_t comma = origin.find(',');
  LOCI_ASSIGN_OR_RETURN(map.x_min_m, NumberIn(yaml_path, "origin", origin));
  LOCI_ASSIGN_OR_RETURN(
      map.y_min_m,
      NumberIn(yaml_path, "origin", comma == std::string::npos ? "" : origin.substr(comma + 1)));
  Thresholds thresholds;
  if (!keys["occupied_thresh"].empty()) {
    LOCI_ASSIGN_OR_RETURN(thresholds.occupied,
                          NumberIn(yaml_path, "occupied_thresh", keys["occupied_thresh"]));
  }
  if (!keys["free_thresh"].empty()) {
    LOCI_ASSIGN_OR_RETURN(thresholds.free, NumberIn(yaml_path, "free_thresh", keys["free_thresh"]));
  }
  thresholds.negate = keys["negate"] == "1" || keys["negate"] == "true";
  const std::filesystem::path image(keys["image"]);
  const std::string pgm_path =
      image.is_absolute() ? image.string()
                          : (std::filesystem::path(yaml_path).parent_path() / image).string();
  LOCI_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(pgm_path));
  LOCI_ASSIGN_OR_RETURN(const Picture picture, ParsePgm(pgm_path, bytes));
  map.width = picture.width;
  map.height = picture.height;
  map.cells.resize(picture.pixels.size());
  for (std::int32_t row = 0; row < map.height; ++row) {
    const auto line =
        static_cast<std::size_t>(map.height - 1 - row) * static_cast<std::size_t>(map.width);
    for (std::int32_t column = 0; column < map.width; ++column) {
      map.at(column, row) = CellOf(
          picture.pixels[line + static_cast<std::size_t>(column)], picture.grey_max, thresholds);
    }
  }
  return map;
}

}  // namespace loci
