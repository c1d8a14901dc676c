// SPDX-License-Identifier: Apache-2.0
// Claim: writing a scan into a place's local grid is faster than MRPT's insertObservation, for 180,
// 361 and 1080 beams in an office, in the same run.
//
//   integrate_bench [--tiny]
//
// Without MRPT (libmrpt-maps-dev) only our own figures are given, and that is said. Ends with 1 if
// MRPT is faster (not with --tiny).
#include <cstdio>
#include <vector>

#ifdef LOCI_HAVE_MRPT
#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/poses/CPose3D.h>
#endif

#include "bench/interleaved.h"
#include "core/grid/occupancy_grid.h"
#include "core/scan/scan_points.h"
#include "tests/support/generator.h"

namespace loci {
namespace {

constexpr double kCellM = 0.05;
constexpr double kRangeMaxM = 15.0;

// A corridor of 30 m with offices on both sides; their doors are open.
SimulatedWorld Office() {
  SimulatedWorld world;
  world.AddBox({-15.0, -6.5}, {15.0, 6.5});
  for (int room = 0; room < 6; ++room) {
    const double x = -15.0 + 5.0 * room;
    for (const double side : {-1.0, 1.0}) {
      world.AddWall({x, side * 1.2}, {x + 2.0, side * 1.2});
      world.AddWall({x + 3.0, side * 1.2}, {x + 5.0, side * 1.2});
      world.AddWall({x + 5.0, side * 1.2}, {x + 5.0, side * 6.5});
      world.AddBox({x + 0.6, side > 0.0 ? 4.6 : -5.4}, {x + 2.2, side > 0.0 ? 5.4 : -4.6});
    }
  }
  return world;
}

struct PosedScan {
  Pose2 pose;
  LaserScan scan;
};

std::vector<PosedScan> MakeScans(std::size_t beams, std::size_t count, RandomSequence& random) {
  const SimulatedWorld world = Office();
  Scanner scanner;
  scanner.beam_count = beams;
  const double span_rad = beams == 1080 ? 1.5 * kPi : kPi;
  scanner.angle_min_rad = -0.5 * span_rad;
  scanner.angle_step_rad = span_rad / static_cast<double>(beams);
  std::vector<PosedScan> scans;
  for (std::size_t i = 0; i < count; ++i) {
    const Pose2 pose{random.NextUniform(-3.0, 3.0),
                     random.NextUniform(-0.8, 0.8),
                     random.NextUniform(-3.0, 3.0)};
    scans.push_back({pose, world.Scan(pose, scanner, random)});
  }
  return scans;
}

std::uint64_t IntegrateAll(const std::vector<PosedScan>& scans) {
  LogOddsGrid grid;
  std::uint64_t written = 0;
  for (const PosedScan& posed : scans) {
    std::vector<Eigen::Vector2d> hits;
    hits.reserve(posed.scan.ranges_mm.size());
    for (const ScanPoint& point : ToPoints(posed.scan, kRangeMaxM)) {
      hits.push_back(point.point_in_robot);
    }
    written += IntegrateScan(posed.scan, hits, posed.pose, kRangeMaxM, kCellM, grid);
  }
  return written;
}

#ifdef LOCI_HAVE_MRPT

// The same scans as MRPT has them; made before the clock runs.
struct MrptScan {
  mrpt::obs::CObservation2DRangeScan scan;
  mrpt::poses::CPose3D pose;
};

std::vector<MrptScan> ToMrpt(const std::vector<PosedScan>& scans) {
  std::vector<MrptScan> converted;
  for (const PosedScan& posed : scans) {
    MrptScan to;
    const std::size_t count = posed.scan.ranges_mm.size();
    to.scan.aperture =
        static_cast<float>(posed.scan.angle_step_rad * static_cast<double>(count - 1));
    to.scan.rightToLeft = true;
    to.scan.maxRange = static_cast<float>(kRangeMaxM);
    to.scan.resizeScan(count);
    for (std::size_t i = 0; i < count; ++i) {
      const bool seen = posed.scan.ranges_mm[i] != LaserScan::kNothingSeen;
      to.scan.setScanRange(i, seen ? 0.001F * static_cast<float>(posed.scan.ranges_mm[i]) : 0.0F);
      to.scan.setScanRangeValidity(i, seen);
    }
    to.pose = mrpt::poses::CPose3D(posed.pose.x, posed.pose.y, 0.0, posed.pose.theta, 0.0, 0.0);
    converted.push_back(std::move(to));
  }
  return converted;
}

void InsertAll(const std::vector<MrptScan>& scans) {
  // As large as it will need: MRPT's growing is not what is compared.
  mrpt::maps::COccupancyGridMap2D map(-20.0F, 20.0F, -20.0F, 20.0F, static_cast<float>(kCellM));
  map.insertionOptions.maxDistanceInsertion = static_cast<float>(kRangeMaxM);
  for (const MrptScan& scan : scans) {
    map.insertObservation(scan.scan, scan.pose);
  }
}

bool Compare(std::size_t beams, bool tiny, const std::vector<PosedScan>& scans) {
  const std::vector<MrptScan> converted = ToMrpt(scans);
  const InterleavedTimes times = MeasureInterleaved(
      tiny ? 1 : 5, [&] { IntegrateAll(scans); }, [&] { InsertAll(converted); });
  const double scale = 1e6 / static_cast<double>(scans.size());
  std::printf("integrate %4zu beams: %.1f us, MRPT %.1f us, ratio %.1f\n",
              beams,
              scale * times.ours_s,
              scale * times.theirs_s,
              times.ratio);
  return tiny || times.ratio > 1.0;
}

#else

bool Compare(std::size_t beams, bool tiny, const std::vector<PosedScan>& scans) {
  const InterleavedTimes times = MeasureInterleaved(
      tiny ? 1 : 5, [&] { IntegrateAll(scans); }, [] {});
  std::printf("integrate %4zu beams: %.1f us; SKIPPED the comparison: no libmrpt-maps-dev\n",
              beams,
              1e6 * times.ours_s / static_cast<double>(scans.size()));
  return true;
}

#endif

int Run(bool tiny) {
  RandomSequence random(1);
  bool faster = true;
  for (const std::size_t beams : {std::size_t{180}, std::size_t{361}, std::size_t{1080}}) {
    faster = Compare(beams, tiny, MakeScans(beams, tiny ? 3 : 200, random)) && faster;
  }
  return faster ? 0 : 1;
}

}  // namespace
}  // namespace loci

int main(int argc, char** argv) {
  return loci::Run(loci::IsTiny(argc, argv));
}
