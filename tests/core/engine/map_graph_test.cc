// SPDX-License-Identifier: Apache-2.0
// The engine's graph against the batch optimiser, and as it is written down and read back.
#include "core/engine/map_graph.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/archive.h"
#include "core/graph/optimize.h"
#include "tests/core/graph/random_graph.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

RobustKernel Kernel() {
  return {RobustKernel::Shape::kCauchy, 3.0};
}

double CostOf(const PoseGraph& graph) {
  double cost = 0.0;
  for (const GraphConstraint& constraint : graph.constraints) {
    const double chi2 = Chi2Of(graph, constraint);
    cost += constraint.robust ? Kernel().Rho(chi2) : chi2;
  }
  return cost;
}

double BatchCost(PoseGraph graph) {
  OptimizeOptions options;
  options.sparse.kernel = Kernel();
  EXPECT_THAT(OptimizeGraph(graph, options), IsOk());
  return CostOf(graph);
}

// Takes the nodes of a graph in turn, each with its closures to those before. `id` counts closures.
class Driver {
 public:
  explicit Driver(PoseGraph whole) : whole_(std::move(whole)) {}

  bool is_done() const { return next_ == whole_.map_from_node.size(); }
  std::uint32_t next() const { return next_; }

  void Advance(MapGraph& map) {
    std::optional<GraphConstraint> tie;
    std::vector<MapConstraint> closures;
    for (const GraphConstraint& constraint : whole_.constraints) {
      if (std::max(constraint.from, constraint.to) != next_) {
        continue;
      }
      if (!constraint.robust) {
        tie = constraint;
      } else {
        closures.push_back({constraint, ClosureId{closure_count_++}});
      }
    }
    const Pose2 place = tie.has_value() ? map.map_from_place(PlaceId{tie->from}) * tie->from_from_to
                                        : whole_.map_from_node[next_];
    map.AddPlace(place, tie);
    if (!closures.empty()) {
      map.AddClosures(closures);
    }
    ++next_;
  }

 private:
  PoseGraph whole_;
  std::uint32_t next_ = 0;
  std::uint32_t closure_count_ = 0;
};

std::string BytesOf(MapGraph& map) {
  BinaryWriter writer;
  map.BaseFields(writer);
  map.StepFields(writer);
  return writer.TakeBytes();
}

// The base of one graph, the steps of another.
StatusOr<MapGraph> ReadBack(MapGraph& base, MapGraph& steps) {
  BinaryWriter base_writer;
  base.BaseFields(base_writer);
  BinaryWriter step_writer;
  steps.StepFields(step_writer);
  MapGraph read;
  BinaryReader base_reader(base_writer.bytes());
  read.BaseFields(base_reader);
  EXPECT_THAT(base_reader.Finish("base"), IsOk());
  BinaryReader step_reader(step_writer.bytes());
  read.StepFields(step_reader);
  EXPECT_THAT(step_reader.Finish("steps"), IsOk());
  LOCI_RETURN_IF_ERROR(read.Restore());
  return read;
}

TEST(MapGraphTest, IsWhereTheBatchOptimumIs) {
  for (const PoseGraph& whole : {RandomLoopGraph(1, 350), RandomManhattanGraph(2, 350)}) {
    Driver driver(whole);
    MapGraph map;
    while (!driver.is_done()) {
      driver.Advance(map);
      if (driver.next() % 25 == 0) {
        const double optimum = BatchCost(map.graph());
        EXPECT_LE(CostOf(map.graph()), optimum * (1.0 + 1e-3) + 1e-3) << driver.next();
      }
    }
    EXPECT_GE(map.base_count(), 2U) << "the steps have become a base";
  }
}

TEST(MapGraphTest, ReadBackAtAnyStepItGoesOnWithTheSameBits) {
  const PoseGraph whole = RandomManhattanGraph(3, 300);
  MapGraph never;
  Driver driver(whole);
  while (!driver.is_done()) {
    driver.Advance(never);
  }
  const std::string ending = BytesOf(never);

  MapGraph map;
  driver = Driver(whole);
  while (!driver.is_done()) {
    driver.Advance(map);
    if (driver.next() % 17 == 0) {
      StatusOr<MapGraph> read = ReadBack(map, map);
      ASSERT_THAT(read, IsOk());
      EXPECT_EQ(read->map_from_places(), map.map_from_places()) << driver.next();
      const PlaceId last{driver.next() - 1};
      EXPECT_EQ(read->RelativeCovariance(PlaceId{0}, last),
                map.RelativeCovariance(PlaceId{0}, last));
      map = std::move(read).value();
    }
  }
  EXPECT_EQ(BytesOf(map), ending);
  EXPECT_EQ(map.map_from_places(), never.map_from_places());
}

TEST(MapGraphTest, ClosuresOfOneEventGiveTheSameBitsInAnyOrder) {
  const PoseGraph whole = RandomLoopGraph(4, 60);
  Driver driver(whole);
  MapGraph start;
  while (!driver.is_done()) {
    driver.Advance(start);
  }
  std::vector<MapConstraint> closures;
  for (std::uint32_t i = 0; i < 4; ++i) {
    const Pose2 now =
        Inverse(start.map_from_place(PlaceId{i})) * start.map_from_place(PlaceId{i / 2 + 40});
    closures.push_back(
        {{i, i / 2 + 40, now * Pose2{0.1, 0.05, 0.01}, 400.0 * Eigen::Matrix3d::Identity(), true},
         ClosureId{1000 + i}});
  }
  const auto ending_with = [&](const std::vector<MapConstraint>& order) {
    StatusOr<MapGraph> map = ReadBack(start, start);
    EXPECT_THAT(map, IsOk());
    map->AddClosures(order);
    return BytesOf(*map);
  };
  const std::string ending = ending_with(closures);
  std::reverse(closures.begin(), closures.end());
  EXPECT_EQ(ending_with(closures), ending);
  std::swap(closures[1], closures[2]);
  EXPECT_EQ(ending_with(closures), ending);
}

TEST(MapGraphTest, ARemovedClosureLeavesTheGraphThatNeverHadIt) {
  Driver driver(RandomLoopGraph(5, 120));
  MapGraph map;
  while (!driver.is_done()) {
    driver.Advance(map);
  }
  const double cost = CostOf(map.graph());
  const std::size_t closures = map.closure_count();
  const Pose2 now = Inverse(map.map_from_place(PlaceId{3})) * map.map_from_place(PlaceId{111});
  map.AddClosures(
      {{{3, 111, now * Pose2{0.5, -0.5, 0.1}, 400.0 * Eigen::Matrix3d::Identity(), true},
        ClosureId{999}}});
  EXPECT_EQ(map.closure_count(), closures + 1);
  EXPECT_GT(CostOf(map.graph()), cost + 1.0);
  map.RemoveClosure(ClosureId{999});
  EXPECT_EQ(map.closure_count(), closures);
  EXPECT_NEAR(CostOf(map.graph()), cost, 1e-3 * cost);
}

TEST(MapGraphTest, WrongClosuresNeverEndAboveTheCostOfStandingStill) {
  PoseGraph chain = RandomLoopGraph(6, 100);
  std::erase_if(chain.constraints, [](const GraphConstraint& each) { return each.robust; });
  Driver driver(chain);
  MapGraph map;
  while (!driver.is_done()) {
    driver.Advance(map);
  }
  RandomSequence random(7);
  std::uint64_t batches = 0;
  for (std::uint32_t i = 0; i < 40; ++i) {
    const auto from = static_cast<std::uint32_t>(random.NextBits() % 100);
    const auto to = static_cast<std::uint32_t>((from + 1 + random.NextBits() % 99) % 100);
    const GraphConstraint wrong{
        from, to, RandomPose(random, 30.0, kPi), 1e4 * Eigen::Matrix3d::Identity(), true};
    PoseGraph standing = map.graph();
    standing.constraints.push_back(wrong);
    const std::uint64_t bases = map.base_count();
    map.AddClosures({{wrong, ClosureId{5000 + i}}});
    EXPECT_LE(CostOf(map.graph()), CostOf(standing) * (1.0 + 2e-3) + 2e-2) << i;
    batches += map.base_count() - bases;
  }
  EXPECT_GT(batches, 0U) << "the batch optimiser had to help, or this tests nothing";
}

TEST(MapGraphTest, TiesOfEveryCertaintyThatAnEventMayHaveAreTaken) {
  // Standard deviations from 1e-7 to 1e3, m and rad, turned anyhow: event_validation.cc.
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    RandomSequence random(seed);
    MapGraph map;
    map.AddPlace({}, {});
    for (std::uint32_t place = 1; place < 80; ++place) {
      const double turn = random.NextUniform(-kPi, kPi);
      Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
      axes.topLeftCorner<2, 2>() << std::cos(turn), -std::sin(turn), std::sin(turn), std::cos(turn);
      Eigen::Vector3d weights;
      for (int i = 0; i < 3; ++i) {
        weights(i) = std::pow(10.0, -2.0 * random.NextUniform(-7.0, 3.0));
      }
      const Eigen::Matrix3d information = axes * weights.asDiagonal() * axes.transpose();
      const GraphConstraint tie{place - 1,
                                place,
                                RandomPose(random, 1000.0, kPi),
                                0.5 * (information + information.transpose()),
                                false};
      map.AddPlace(map.map_from_place(PlaceId{place - 1}) * tie.from_from_to, tie);
      if (place % 8 == 7) {
        const std::uint32_t from = place / 2;
        const Pose2 now =
            Inverse(map.map_from_place(PlaceId{from})) * map.map_from_place(PlaceId{place});
        map.AddClosures({{{from,
                           place,
                           now * Pose2{0.3, -0.2, 0.05},
                           Eigen::Vector3d(1e4, 1e4, 1e5).asDiagonal(),
                           true},
                          ClosureId{place}}});
      }
      const Eigen::Matrix3d doubt = map.RelativeCovariance(PlaceId{0}, PlaceId{place});
      EXPECT_TRUE(doubt.allFinite()) << seed << " " << place;
      EXPECT_GE(doubt.diagonal().minCoeff(), 0.0) << seed << " " << place;
    }
  }
}

TEST(MapGraphTest, CovariancesAreThoseOfTheBatch) {
  Driver driver(RandomLoopGraph(8, 90));
  MapGraph map;
  while (!driver.is_done()) {
    driver.Advance(map);
  }
  StatusOr<GraphCovariance> batch = GraphCovariance::Compute(map.graph(), Kernel());
  ASSERT_THAT(batch, IsOk());
  for (const auto& [from, to] : {std::pair{0U, 89U}, {17U, 71U}, {71U, 17U}, {44U, 45U}}) {
    const Eigen::Matrix3d expected = batch->Relative(from, to);
    EXPECT_LE((map.RelativeCovariance(PlaceId{from}, PlaceId{to}) - expected).norm(),
              1e-2 * expected.norm())
        << from << " " << to;
  }
  EXPECT_EQ(map.RelativeCovariance(PlaceId{5}, PlaceId{5}), Eigen::Matrix3d::Zero());
}

TEST(MapGraphTest, StepsOfAnotherBaseAreDataLoss) {
  Driver driver(RandomLoopGraph(9, 200));
  MapGraph map;
  while (map.base_count() == 0) {
    driver.Advance(map);
  }
  MapGraph young;
  Driver again(RandomLoopGraph(9, 200));
  again.Advance(young);
  EXPECT_THAT(ReadBack(map, young), IsStatus(StatusCode::kDataLoss, "another base"));
  EXPECT_THAT(ReadBack(young, map), IsStatus(StatusCode::kDataLoss, "another base"));
}

TEST(MapGraphTest, StepsThatDoNotFollowTheirBaseAreDataLoss) {
  Driver driver(RandomLoopGraph(10, 60));
  MapGraph longer;
  while (!driver.is_done()) {
    driver.Advance(longer);
  }
  MapGraph other;  // whose steps are none
  StatusOr<MapGraph> empty = ReadBack(other, other);
  ASSERT_THAT(empty, IsOk());
  EXPECT_TRUE(empty->map_from_places().empty());
  // A bit of the steps is wrong: numbers of places, kinds, poses, information. Nothing ends the
  // process.
  BinaryWriter writer;
  longer.StepFields(writer);
  std::size_t refused = 0;
  for (std::size_t at = 8; at < writer.bytes().size(); at += 61) {
    std::string bytes = writer.bytes();
    bytes[at] = static_cast<char>(bytes[at] ^ 0x40);
    MapGraph read;
    BinaryReader reader(bytes);
    read.StepFields(reader);
    if (reader.Finish("steps").ok()) {
      const Status restored = read.Restore();
      refused += restored.ok() ? 0U : 1U;
      EXPECT_TRUE(restored.ok() || restored.code() == StatusCode::kDataLoss) << at;
    }
  }
  EXPECT_GT(refused, 10U);
}

}  // namespace
}  // namespace loci
