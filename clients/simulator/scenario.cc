// SPDX-License-Identifier: Apache-2.0
#include "clients/simulator/scenario.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "clients/simulator/scenario_parts.h"
#include "core/base/random.h"

namespace loci::simulator {
namespace {

using Eigen::Vector2d;

struct Entry {
  std::string_view name;
  std::string_view what;
  Scenario (*make)();
};
constexpr std::array<Entry, 5> kScenarios = {{
    {"office",
     "two robots at once in an office with a ring of corridors; doors, furniture, people",
     MakeOffice},
    {"office-days",
     "one robot in the same office on three days; furniture moves and doors open in between",
     MakeOfficeDays},
    {"loop", "one robot, a corridor that closes after 224 m, bad odometry", MakeLoop},
    {"self-similar",
     "one robot in a building of identical corridors, rooms and floors, no place seen twice",
     MakeSelfSimilar},
    {"long-corridor", "one robot, 120 m of bare corridor, out and back", MakeLongCorridor},
}};

double DistanceToWay(const Vector2d& point, const std::vector<Vector2d>& way) {
  double nearest_m = (way.front() - point).norm();
  for (std::size_t i = 1; i < way.size(); ++i) {
    const Vector2d leg = way[i] - way[i - 1];
    const double share = std::clamp((point - way[i - 1]).dot(leg) / leg.squaredNorm(), 0.0, 1.0);
    nearest_m = std::min(nearest_m, (way[i - 1] + share * leg - point).norm());
  }
  return nearest_m;
}

}  // namespace

std::vector<ScenarioName> ScenarioNames() {
  std::vector<ScenarioName> names;
  for (const Entry& entry : kScenarios) {
    names.push_back({std::string(entry.name), std::string(entry.what)});
  }
  return names;
}

StatusOr<Scenario> MakeScenario(const std::string& name) {
  std::string known;
  for (const Entry& entry : kScenarios) {
    if (entry.name == name) {
      return entry.make();
    }
    known += (known.empty() ? "" : ", ") + std::string(entry.name);
  }
  return NotFoundError("scenario: there is no \"" + name + "\"; there are " + known);
}

void Furnish(FloorPlan& plan,
             const Vector2d& low,
             const Vector2d& high,
             std::uint64_t layout,
             const std::vector<std::vector<Vector2d>>& ways) {
  struct Kind {
    Vector2d size_m;
    bool movable;
  };
  static const std::array<Kind, 3> kinds = {{{{1.4, 0.7}, false},    // desk
                                             {{0.9, 0.4}, false},    // cabinet
                                             {{0.5, 0.45}, true}}};  // chair
  constexpr int kPieces = 7;
  constexpr double kWallM = 0.15;
  constexpr double kMovesM = 0.6;  // at most, from day to day
  constexpr double kRobotM = 0.45;
  RandomSequence random(MixBits(layout));
  for (int piece = 0; piece < kPieces; ++piece) {
    const Kind& kind = kinds[static_cast<std::size_t>(piece) % kinds.size()];
    const double margin_m = 0.5 * kind.size_m.norm() + (kind.movable ? kMovesM : 0.0);
    const double x = random.NextUniform(low.x() + margin_m + kWallM, high.x() - margin_m - kWallM);
    const double y = random.NextUniform(low.y() + margin_m + kWallM, high.y() - margin_m - kWallM);
    const double quarter_turns = std::floor(random.NextUniform(0.0, 4.0));
    const bool clear = std::all_of(ways.begin(), ways.end(), [&](const std::vector<Vector2d>& way) {
      return DistanceToWay({x, y}, way) > margin_m + kRobotM;
    });
    if (clear) {
      plan.AddFurniture({.centre = {x, y},
                         .size_m = kind.size_m,
                         .angle_rad = quarter_turns * kPi / 2.0 + (kind.movable ? 0.3 : 0.0),
                         .movable = kind.movable});
    }
  }
}

}  // namespace loci::simulator
