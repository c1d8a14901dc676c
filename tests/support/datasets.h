// SPDX-License-Identifier: Apache-2.0
// Public data sets for tests and benchmarks: real logs and graphs that are not part of the project.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include <gtest/gtest.h>

#include "core/base/status.h"

namespace loci {

// The folder named by LOCI_DATASETS, or ../shared/datasets beside the source tree.
std::filesystem::path DatasetsFolder();

// The content of DatasetsFolder() / `name`; .gz and .bz2 come uncompressed. kNotFound if the file
// is missing, with a message that says how to point to it; kDataLoss if it cannot be uncompressed.
StatusOr<std::string> ReadDataset(std::string_view name);

}  // namespace loci

// Declares `std::string variable` with the data set's content, or skips the test and says why. In
// the body of a test only:
//   LOCI_DATASET_OR_SKIP(text, "graphs/intel_g2o.g2o.gz");
#define LOCI_DATASET_OR_SKIP(variable, name)                                                       \
  std::string variable;                                                                            \
  if (::loci::StatusOr<std::string> loci_content = ::loci::ReadDataset(name); loci_content.ok()) { \
    variable = std::move(loci_content).value();                                                    \
  } else if (loci_content.status().code() == ::loci::StatusCode::kNotFound) {                      \
    GTEST_SKIP() << loci_content.status().message();                                               \
  } else {                                                                                         \
    FAIL() << loci_content.status().ToString();                                                    \
  }
