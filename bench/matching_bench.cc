// SPDX-License-Identifier: Apache-2.0
// Claim: matching in the tracking window (+-0.3 m, +-20 degrees, 0.05 m, 0.5 degrees) with 180
// beams is at least ten times as fast as the plain loop over all poses, with the same best score
// always.
//
//   matching_bench [--tiny]
//
// Ends with 1 if a result differs, or (without --tiny) if the ratio is below ten.
#include <cstdio>
#include <vector>

#include "bench/interleaved.h"
#include "core/matching/correlative_search.h"
#include "tests/support/patches.h"

namespace loci {
namespace {

struct Scene {
  std::vector<Eigen::Vector2d> points;
  Pose2 predicted;
};

std::vector<Scene> MakeScenes(const SimulatedWorld& world,
                              std::size_t count,
                              RandomSequence& random) {
  std::vector<Scene> scenes;
  while (scenes.size() < count) {
    const Pose2 pose{random.NextUniform(-1.5, 1.0),
                     random.NextUniform(-1.5, 1.0),
                     random.NextUniform(-3.0, 3.0)};
    const Pose2 offset{random.NextUniform(-0.25, 0.25),
                       random.NextUniform(-0.25, 0.25),
                       random.NextUniform(-0.3, 0.3)};
    scenes.push_back({PointsOf(world.Scan(pose, Scanner(), random)), pose * offset});
  }
  return scenes;
}

int Run(bool tiny) {
  RandomSequence random(1);
  const SimulatedWorld world = FurnishedRoom();
  const LikelihoodGrid grid = LikelihoodGrid::OfPatch(PatchOfRoom(random), 1);
  const std::vector<Scene> scenes = MakeScenes(world, tiny ? 2 : 40, random);
  SearchWindow window;
  window.half_x_m = window.half_y_m = 0.3;
  window.half_theta_rad = 20.0 * kPi / 180.0;
  window.step_theta_rad = 0.5 * kPi / 180.0;
  std::vector<CorrelativeMatch> ours(scenes.size());
  std::vector<CorrelativeMatch> plain(scenes.size());
  const InterleavedTimes times = MeasureInterleaved(
      tiny ? 1 : 5,
      [&] {
        for (std::size_t i = 0; i < scenes.size(); ++i) {
          ours[i] = FindBestPose(scenes[i].points, scenes[i].predicted, window, grid);
        }
      },
      [&] {
        for (std::size_t i = 0; i < scenes.size(); ++i) {
          plain[i] = FindBestPosePlainly(scenes[i].points, scenes[i].predicted, window, grid);
        }
      });
  std::size_t same = 0;
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    same += ours[i].score == plain[i].score && ours[i].grid_from_robot == plain[i].grid_from_robot
                ? 1U
                : 0U;
  }
  const double count = static_cast<double>(scenes.size());
  std::printf(
      "matching: %.3f ms, plain loop %.3f ms, ratio %.1f, same best score and pose in %zu of %zu\n",
      1000.0 * times.ours_s / count,
      1000.0 * times.theirs_s / count,
      times.ratio,
      same,
      scenes.size());
  return same == scenes.size() && (tiny || times.ratio >= 10.0) ? 0 : 1;
}

}  // namespace
}  // namespace loci

int main(int argc, char** argv) {
  return loci::Run(loci::IsTiny(argc, argv));
}
