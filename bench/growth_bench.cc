// SPDX-License-Identifier: Apache-2.0
// How the time of a closure grows with the graph, and what room the graph takes.
//
//   growth_bench [--tiny] [--svg FILE]
//
// A robot wanders through Manhattan worlds of 10^3, 10^4 and 10^5 poses; the streets' area is in
// proportion, so that places are seen as often. All but the last poses are optimised as a batch;
// the last are added one by one, each brought to the optimum as it comes. Processor time of one
// thread of those that close a loop, over three worlds of each size: what a closure costs depends
// on where the robot is by then. --svg plots it.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <numeric>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <malloc.h>

#include "bench/interleaved.h"
#include "core/base/random.h"
#include "core/graph/incremental_optimizer.h"
#include "core/graph/sparse_optimizer.h"

namespace loci {
namespace {

constexpr double kSigmaM = 0.02;
constexpr double kSigmaRad = 0.01;
constexpr double kPosesPerCrossing = 4.0;
constexpr std::uint32_t kMeasured = 500;  // poses that are added one by one
constexpr std::uint64_t kWorlds = 3;

// A robot that goes from crossing to crossing, a metre apart, and knows each crossing again.
class Wanderer {
 public:
  Wanderer(std::uint64_t seed, std::uint32_t poses)
      : random_(seed),
        side_(static_cast<int>(std::ceil(std::sqrt(poses / kPosesPerCrossing)))),
        last_at_(static_cast<std::size_t>(side_ * side_), kNobody) {
    Arrive();
  }

  // Goes on by a crossing, and returns what is measured there: odometry first.
  std::vector<GraphConstraint> Step() {
    const Pose2 before = Truth();
    if (random_.NextUnit() < 0.3 || !CanGo(heading_)) {
      do {
        heading_ = (heading_ + (random_.NextUnit() < 0.5 ? 1 : 3)) % 4;
      } while (!CanGo(heading_));
    }
    x_ += kStepX[static_cast<std::size_t>(heading_)];
    y_ += kStepX[static_cast<std::size_t>((heading_ + 3) % 4)];
    std::vector<GraphConstraint> measured = {Measured(node_, node_ + 1, Inverse(before) * Truth())};
    ++node_;
    const std::uint32_t seen = last_at_[Crossing()];
    if (seen != kNobody) {
      measured.push_back(Measured(seen, node_, Inverse(truth_of_[seen]) * Truth()));
    }
    Arrive();
    return measured;
  }

  const Pose2& TruthOf(std::uint32_t node) const { return truth_of_[node]; }

 private:
  static constexpr std::uint32_t kNobody = 0xFFFFFFFFU;
  static constexpr std::array<int, 4> kStepX = {1, 0, -1, 0};  // of y: a quarter turn later

  bool CanGo(int heading) const {
    const int x = x_ + kStepX[static_cast<std::size_t>(heading)];
    const int y = y_ + kStepX[static_cast<std::size_t>((heading + 3) % 4)];
    return x >= 0 && x < side_ && y >= 0 && y < side_;
  }
  std::size_t Crossing() const { return static_cast<std::size_t>(y_ * side_ + x_); }
  Pose2 Truth() const {
    return {static_cast<double>(x_), static_cast<double>(y_), WrapAngle(0.5 * kPi * heading_)};
  }
  void Arrive() {
    last_at_[Crossing()] = node_;
    truth_of_.push_back(Truth());
  }
  GraphConstraint Measured(std::uint32_t from, std::uint32_t to, const Pose2& truth) {
    const Pose2 noise{kSigmaM * random_.NextNormal(),
                      kSigmaM * random_.NextNormal(),
                      kSigmaRad * random_.NextNormal()};
    const double per_m2 = 1.0 / (kSigmaM * kSigmaM);
    return {from,
            to,
            truth * noise,
            Eigen::Vector3d(per_m2, per_m2, 1.0 / (kSigmaRad * kSigmaRad)).asDiagonal(),
            false};
  }

  RandomSequence random_;
  int side_ = 0;
  int x_ = 0;
  int y_ = 0;
  int heading_ = 0;  // quarter turns
  std::uint32_t node_ = 0;
  std::vector<std::uint32_t> last_at_;  // per crossing: the last node there
  std::vector<Pose2> truth_of_;
};

double BytesInUse() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd);
}

struct Point {
  double poses = 0.0;
  double mean_ms = 0.0;
};

// Puts the first poses into the optimiser, at their optimum. Returns how many constraints they
// have.
std::size_t Load(std::uint32_t poses, Wanderer& wanderer, IncrementalOptimizer& optimizer) {
  PoseGraph graph;
  graph.map_from_node = {Pose2{}};
  for (std::uint32_t node = 1; node < poses; ++node) {
    for (const GraphConstraint& constraint : wanderer.Step()) {
      graph.constraints.push_back(constraint);
    }
    graph.map_from_node.push_back(wanderer.TruthOf(node));
  }
  graph.fixed = {true};
  OptimizeSparse(graph, SparseOptions{});
  optimizer.Load(graph);
  optimizer.Update();
  return graph.constraints.size();
}

// What all worlds of one size say.
struct Measurement {
  std::vector<double> seconds;  // of the closures
  double constraints = 0.0;
  double bytes = 0.0;
};

void MeasureWorld(std::uint64_t seed, std::uint32_t poses, Measurement& measurement) {
  Wanderer wanderer(seed, poses);
  const double bytes_before = BytesInUse();
  IncrementalOptimizer optimizer((IncrementalOptions()));
  const std::uint32_t loaded = poses - kMeasured;
  std::size_t constraints = Load(loaded, wanderer, optimizer);
  for (std::uint32_t node = loaded; node < poses; ++node) {
    const std::vector<GraphConstraint> measured = wanderer.Step();
    constraints += measured.size();
    const double begin = CpuSeconds();
    optimizer.AddNode(optimizer.map_from_node(node - 1) * measured.front().from_from_to, false);
    for (const GraphConstraint& constraint : measured) {
      optimizer.AddConstraint(constraint);
    }
    optimizer.Update();
    if (measured.size() > 1) {
      measurement.seconds.push_back(CpuSeconds() - begin);
    }
  }
  measurement.bytes += BytesInUse() - bytes_before;
  measurement.constraints += static_cast<double>(constraints);
}

double MeanMs(std::span<const double> seconds) {
  const double total = std::accumulate(seconds.begin(), seconds.end(), 0.0);
  return 1e3 * total / static_cast<double>(seconds.size());
}

Point Measure(std::uint32_t poses) {
  Measurement all;
  std::string means;  // of each world
  for (std::uint64_t seed = 1; seed <= kWorlds; ++seed) {
    const std::size_t before = all.seconds.size();
    MeasureWorld(seed, poses, all);
    std::array<char, 32> mean{};
    std::snprintf(
        mean.data(), mean.size(), " %.3f", MeanMs(std::span(all.seconds).subspan(before)));
    means += mean.data();
  }
  const Point point{static_cast<double>(poses), MeanMs(all.seconds)};
  std::sort(all.seconds.begin(), all.seconds.end());
  const std::size_t count = all.seconds.size();
  std::printf(
      "%7u poses: %6zu closures, mean %.3f (of each world%s)  median %.3f  95 %% %.3f  max %.3f "
      "ms;  %.0f bytes a pose, %.0f a constraint\n",
      poses,
      count,
      point.mean_ms,
      means.c_str(),
      1e3 * all.seconds[count / 2],
      1e3 * all.seconds[count * 95 / 100],
      1e3 * all.seconds.back(),
      all.bytes / static_cast<double>(kWorlds * poses),
      all.bytes / all.constraints);
  std::fflush(stdout);
  return point;
}

// Both axes logarithmic; beside it, what growth in proportion to the poses would be.
void Plot(const std::vector<Point>& points, const std::string& path) {
  constexpr double kDecade = 120.0;
  constexpr double kLeft = 70.0;
  constexpr double kBottom = 330.0;
  const double first = std::log10(points.front().poses);
  const double lowest = std::floor(std::log10(points.front().mean_ms));
  const auto at = [&](const Point& point) {
    return std::to_string(kLeft + kDecade * (std::log10(point.poses) - first)) + "," +
           std::to_string(kBottom - 0.6 * kDecade * (std::log10(point.mean_ms) - lowest));
  };
  std::ofstream svg(path);
  svg << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"420\" height=\"380\" "
         "font-family=\"sans-serif\" font-size=\"12\">\n"
         "<rect width=\"420\" height=\"380\" fill=\"white\"/>\n";
  const auto line = [&](const std::vector<Point>& of, const char* style) {
    svg << "<polyline fill=\"none\" " << style << " points=\"";
    for (const Point& point : of) {
      svg << at(point) << ' ';
    }
    svg << "\"/>\n";
  };
  std::vector<Point> proportional = points;
  for (Point& point : proportional) {
    point.mean_ms = points.front().mean_ms * point.poses / points.front().poses;
  }
  line(proportional, "stroke=\"#999\" stroke-dasharray=\"4 4\"");
  line(points, "stroke=\"#0060b0\" stroke-width=\"2\"");
  for (const Point& point : points) {
    const std::string where = at(point);
    const std::size_t comma = where.find(',');
    std::array<char, 32> label{};
    std::snprintf(label.data(), label.size(), "%.2f ms", point.mean_ms);
    svg << "<circle r=\"3\" fill=\"#0060b0\" cx=\"" << where.substr(0, comma) << "\" cy=\""
        << where.substr(comma + 1) << "\"/>\n<text x=\"" << where.substr(0, comma) << "\" y=\""
        << std::stod(where.substr(comma + 1)) + 18.0 << "\">" << label.data()
        << "</text>\n<text x=\"" << where.substr(0, comma) << "\" y=\"" << kBottom + 30.0
        << "\" text-anchor=\"middle\">" << point.poses << "</text>\n";
  }
  svg << "<text x=\"200\" y=\"" << kBottom + 46.0
      << "\" text-anchor=\"middle\">poses</text>\n"
         "<text x=\"20\" y=\"20\">mean time of a closure; dashed: in proportion to the "
         "poses</text>\n</svg>\n";
}

}  // namespace
}  // namespace loci

int main(int argc, char** argv) {
  std::vector<loci::Point> points;
  for (const std::uint32_t poses : {1000U, 10000U, 100000U}) {
    if (poses == 1000U || !loci::IsTiny(argc, argv)) {
      points.push_back(loci::Measure(poses));
    }
  }
  for (int i = 1; i + 1 < argc; ++i) {
    if (std::string_view(argv[i]) == "--svg") {
      loci::Plot(points, argv[i + 1]);
    }
  }
  return 0;
}
