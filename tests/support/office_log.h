// SPDX-License-Identifier: Apache-2.0
// The log of a robot that drives around a simulated office.
#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/program.h"

namespace loci {

// Writes a CARMEN log of `count` scans into `directory`, evenly taken from the whole drive of the
// first robot of `loci simulate office`, so that it closes its loop. Returns its path.
inline std::string WriteOfficeLog(const std::filesystem::path& directory, std::size_t count) {
  const Ended simulated = RunProgram({LOCI_CLI, "simulate", "office", "--out", directory});
  EXPECT_EQ(simulated.exit_code, 0) << simulated.error;
  std::string whole;  // the name of the first log
  for (const auto& entry : std::filesystem::directory_iterator(directory)) {
    const std::string path = entry.path();
    if (entry.path().extension() == ".clf" && (whole.empty() || path < whole)) {
      whole = path;
    }
  }
  std::vector<std::string> scans;
  std::string log;
  std::ifstream lines(whole);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("FLASER") || line.starts_with("ROBOTLASER")) {
      scans.push_back(line + "\n");
    } else if (line.starts_with("PARAM")) {
      log += line + "\n";
    }
  }
  EXPECT_GE(scans.size(), count);
  for (std::size_t i = 0; i < count && !scans.empty(); ++i) {
    log += scans[i * (scans.size() - 1) / (count - 1)];
  }
  const std::string path = directory / "office.clf";
  std::ofstream(path, std::ios::binary) << log;
  return path;
}

}  // namespace loci
