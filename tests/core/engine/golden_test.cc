// SPDX-License-Identifier: Apache-2.0
// One small map, bit by bit as it was when tests/golden/loop_map.txt was written.
//
// When the algorithms change, so does the file: LOCI_UPDATE_GOLDEN=1 writes it again. On one tree
// it must hold in every preset, and on every processor.
#include <array>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>

#include <gtest/gtest.h>

#include "core/engine/engine.h"
#include "tests/support/loop_world.h"

namespace loci {
namespace {

std::string ToText(const Pose2& pose) {
  std::array<char, 100> text = {};
  std::snprintf(text.data(), text.size(), "%.17g %.17g %.17g", pose.x, pose.y, pose.theta);
  return text.data();
}

// Says for some moments of the drive where the robot is and what the state's digest is, and at the
// end what was made of it.
std::string DescribeLoop() {
  const SimulatedMap loop = DriveAroundTheBlock(1);
  Engine engine;
  HashArchive events;
  std::string text;
  for (std::size_t i = 0; i < loop.events.size(); ++i) {
    events(EncodeEvent(loop.events[i]));
    engine.Apply(loop.events[i]);
    if (i % 50 == 49 || i + 1 == loop.events.size()) {
      text += "after event " + std::to_string(i + 1) + ": robot " +
              ToText(engine.TakeSnapshot()->sessions[0].map_from_robot) + ", state " +
              engine.StateDigest().ToHex() + "\n";
    }
  }
  const std::shared_ptr<const Snapshot> snapshot = engine.TakeSnapshot();
  text += "events " + events.Finish().ToHex() + "\n";
  text += "snapshot " + DigestOf(*snapshot).ToHex() + "\n";
  text += "closures " + std::to_string(snapshot->closures_accepted) + " of " +
          std::to_string(snapshot->closures->size()) + ", places " +
          std::to_string(snapshot->places.size()) + ", triangles " +
          std::to_string(snapshot->mesh->ltrs.size()) + "\n";
  return text;
}

TEST(GoldenTest, ASmallMapIsTheSameToTheLastBit) {
#if !defined(__x86_64__) || defined(__FMA__)
  GTEST_SKIP() << "Eigen sums in another order, or with fused multiply-add, on other processors";
#endif
  const std::string path = LOCI_GOLDEN_DIR "/loop_map.txt";
  const std::string described = DescribeLoop();
  if (std::getenv("LOCI_UPDATE_GOLDEN") != nullptr) {
    std::ofstream(path) << described;
  }
  std::ifstream in(path);
  const std::string golden{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  EXPECT_EQ(described, golden) << "If the change is meant: LOCI_UPDATE_GOLDEN=1 core_golden_tests";
}

}  // namespace
}  // namespace loci
