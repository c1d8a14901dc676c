// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/text_output.h"

#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>

#include <unistd.h>

namespace loci::cli {

std::string StampText(std::int64_t stamp_ns) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  const bool negative = stamp_ns < 0;
  const std::int64_t seconds = stamp_ns / kSecond;
  const std::int64_t rest = stamp_ns % kSecond;
  std::array<char, 48> buffer = {};
  std::snprintf(buffer.data(),
                buffer.size(),
                "%s%lld.%09lld",
                negative ? "-" : "",
                static_cast<long long>(negative ? -seconds : seconds),
                static_cast<long long>(negative ? -rest : rest));
  return buffer.data();
}

std::string TumLine(std::int64_t stamp_ns, const Pose2& map_from_robot) {
  return StampText(stamp_ns) + ' ' + FixedText(map_from_robot.x, 9) + ' ' +
         FixedText(map_from_robot.y, 9) + " 0 0 0 " + FixedText(Sin(map_from_robot.theta / 2), 12) +
         ' ' + FixedText(Cos(map_from_robot.theta / 2), 12);
}

std::string NumberText(double value) {
  std::array<char, 40> buffer = {};
  const auto result = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return {buffer.data(), result.ptr};
}

std::string FixedText(double value, int decimals) {
  std::array<char, 400> buffer = {};
  std::snprintf(buffer.data(), buffer.size(), "%.*f", decimals, value);
  return buffer.data();
}

Status WriteFile(const std::string& path, std::string_view bytes) {
  const std::string temporary = path + ".part" + std::to_string(getpid());
  std::FILE* file = std::fopen(temporary.c_str(), "wb");
  if (file == nullptr) {
    return InvalidArgumentError(path + ": cannot be written: " + std::strerror(errno));
  }
  const bool written = std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
  const bool closed = std::fclose(file) == 0;
  if (!written || !closed || std::rename(temporary.c_str(), path.c_str()) != 0) {
    const int error = errno;
    std::remove(temporary.c_str());
    return Status(error == ENOSPC ? StatusCode::kResourceExhausted : StatusCode::kUnknown,
                  path + ": cannot be written: " + std::strerror(error));
  }
  return {};
}

}  // namespace loci::cli
