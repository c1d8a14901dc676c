// SPDX-License-Identifier: Apache-2.0
// Numbers as texts, and files that appear whole or not at all.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/base/status.h"
#include "core/geometry/se2.h"

namespace loci::cli {

// Seconds with nine decimals: 976052857.337530000.
std::string StampText(std::int64_t stamp_ns);

// One line of a TUM trajectory: stamp x y z qx qy qz qw, without the newline.
std::string TumLine(std::int64_t stamp_ns, const Pose2& map_from_robot);

// Shortest decimals that give the same double.
std::string NumberText(double value);
// With this many decimals.
std::string FixedText(double value, int decimals);

// Writes a file beside its final name and renames it, so that nobody sees half of it. An error
// names the path.
Status WriteFile(const std::string& path, std::string_view bytes);

}  // namespace loci::cli
