// SPDX-License-Identifier: Apache-2.0
// What the largest loop closure of a log costs: from its scan to consistent tiles, against
// inserting all scans so far into a grid anew, in one run.
//
//   closure_bench LOG [--pictures PREFIX]
//
// With --pictures, PREFIX.before.pgm and PREFIX.after.pgm show the map on both sides of it.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <string>
#include <variant>
#include <vector>

#include "bench/map_of_log.h"
#include "core/grid/occupancy_grid.h"
#include "core/scan/scan_points.h"
#include "core/tile/tile_renderer.h"
#include "core/tile/zoom.h"

namespace loci {
namespace {

double Seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// How far the place that moved furthest moved between two states.
double LargestMoveM(const Snapshot& before, const Snapshot& after) {
  double largest = 0.0;
  for (std::size_t i = 0; i < std::min(before.places.size(), after.places.size()); ++i) {
    const Eigen::Vector2d moved = after.places[i].map_from_place.translation() -
                                  before.places[i].map_from_place.translation();
    largest = std::max(largest, moved.norm());
  }
  return largest;
}

struct Closure {
  EventNumber event;
  double move_m = 0.0;
};

StatusOr<Closure> FindLargestClosure(const std::string& log) {
  Closure largest;
  std::shared_ptr<const Snapshot> before;
  MapOfLogOptions options;
  options.after_event = [&](Engine& engine, const Effects& effects) {
    if (!effects.closure_accepted && !effects.place_finished) {
      return;
    }
    const std::shared_ptr<const Snapshot> after = engine.TakeSnapshot();
    if (before != nullptr && LargestMoveM(*before, *after) > largest.move_m) {
      largest = {engine.last_event(), LargestMoveM(*before, *after)};
    }
    before = after;
  };
  LOCI_ASSIGN_OR_RETURN(const MappedLog mapped, MapOfLog(log, options));
  (void)mapped;
  return largest;
}

void WritePicture(const Snapshot& snapshot, const BoxInMap& box, const std::string& path) {
  RasterRegion region;
  region.origin_in_map = box.min;
  region.resolution_m = 0.05;
  region.width = static_cast<std::int32_t>(std::ceil((box.max.x() - box.min.x()) / 0.05));
  region.height = static_cast<std::int32_t>(std::ceil((box.max.y() - box.min.y()) / 0.05));
  const RasterImage image = RenderRegion(snapshot, Layer::kOccupancy, region);
  std::ofstream out(path, std::ios::binary);
  out << "P5\n" << image.width << ' ' << image.height << "\n255\n";
  for (std::int32_t row = image.height - 1; row >= 0; --row) {
    for (std::int32_t column = 0; column < image.width; ++column) {
      const LogOdds8 value =
          image.pixels[static_cast<std::size_t>(row) * static_cast<std::size_t>(image.width) +
                       static_cast<std::size_t>(column)];
      const int grey = value == kUnobserved ? 205 : (value > 0 ? 0 : 254);
      out.put(static_cast<char>(grey));
    }
  }
}

// All scans so far, with the poses that the trajectory has now, into one grid.
double ReinsertAll(const std::vector<LaserScan>& scans, const Snapshot& snapshot) {
  std::vector<Pose2> poses;
  for (const auto& piece : snapshot.sessions[0].trajectory) {
    for (const TrajectoryPose& pose : *piece) {
      poses.push_back(snapshot.places[pose.place.value].map_from_place * pose.place_from_robot);
    }
  }
  const double begin = Seconds();
  LogOddsGrid grid;
  for (std::size_t i = 0; i < std::min(scans.size(), poses.size()); ++i) {
    std::vector<Eigen::Vector2d> hits;
    for (const ScanPoint& point : ToPoints(scans[i], snapshot.settings.range_max_m)) {
      hits.push_back(point.point_in_robot);
    }
    IntegrateScan(scans[i],
                  hits,
                  poses[i],
                  snapshot.settings.range_max_m,
                  snapshot.settings.cell_size_m,
                  grid);
  }
  return Seconds() - begin;
}

// Everything that is measured at the event of the closure.
class ClosureMeter {
 public:
  ClosureMeter(EventNumber event, std::string pictures)
      : event_(event), pictures_(std::move(pictures)) {}

  void Before(Engine& engine, const Event& event) {
    if (const auto* observation = std::get_if<ObservationEvent>(&event);
        observation != nullptr && !done_) {
      scans_.push_back(*observation->scan);
    }
    if (engine.last_event().value + 1 == event_.value) {
      before_ = engine.TakeSnapshot();
      begin_ = Seconds();
    }
  }

  void After(Engine& engine) {
    if (engine.last_event() != event_) {
      return;
    }
    done_ = true;
    const double applied = Seconds();
    const std::shared_ptr<const Snapshot> after = engine.TakeSnapshot();
    const double published = Seconds();
    const BoxInMap box = MapBounds(*after, Layer::kOccupancy);
    const std::vector<TileAddress> tiles = TilesUnder(box, kDirtyTileZoom);
    for (const TileAddress& tile : tiles) {
      RenderTile(*after, Layer::kOccupancy, tile);
    }
    const double rendered = Seconds();
    const double reinserted = ReinsertAll(scans_, *after);
    std::printf("event %llu, %zu scans so far, %zu places, %zu tiles\n",
                static_cast<unsigned long long>(event_.value),
                scans_.size(),
                after->places.size(),
                tiles.size());
    std::printf("apply %.1f ms, publish %.2f ms, all tiles %.1f ms: %.1f ms together\n",
                1e3 * (applied - begin_),
                1e3 * (published - applied),
                1e3 * (rendered - published),
                1e3 * (rendered - begin_));
    std::printf("inserting all scans again: %.1f ms, %.1f times as much\n",
                1e3 * reinserted,
                reinserted / (rendered - begin_));
    std::printf("cells written by the closure: %llu\n",
                static_cast<unsigned long long>(after->cells_written.closure));
    if (!pictures_.empty()) {
      BoxInMap both = box;
      both.Extend(MapBounds(*before_, Layer::kOccupancy));
      WritePicture(*before_, both, pictures_ + ".before.pgm");
      WritePicture(*after, both, pictures_ + ".after.pgm");
    }
  }

 private:
  EventNumber event_;
  std::string pictures_;
  std::vector<LaserScan> scans_;
  std::shared_ptr<const Snapshot> before_;
  double begin_ = 0.0;
  bool done_ = false;
};

Status Run(const std::string& log, const std::string& pictures) {
  LOCI_ASSIGN_OR_RETURN(const Closure largest, FindLargestClosure(log));
  if (largest.event.value == 0) {
    return NotFoundError(log + ": no loop closes");
  }
  std::printf("largest closure: the place that moved furthest moved %.3f m\n", largest.move_m);
  ClosureMeter meter(largest.event, pictures);
  MapOfLogOptions options;
  options.before_event = [&](Engine& engine, const Event& event) { meter.Before(engine, event); };
  options.after_event = [&](Engine& engine, const Effects& /*effects*/) { meter.After(engine); };
  return MapOfLog(log, options).status();
}

}  // namespace
}  // namespace loci

int main(int argc, char** argv) {
  std::string log;
  std::string pictures;
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "--pictures" && i + 1 < argc) {
      pictures = argv[++i];
    } else {
      log = argv[i];
    }
  }
  if (log.empty()) {
    std::fprintf(stderr, "usage: closure_bench LOG [--pictures PREFIX]\n");
    return 2;
  }
  if (const loci::Status status = loci::Run(log, pictures); !status.ok()) {
    std::fprintf(stderr, "%s\n", status.ToString().c_str());
    return 1;
  }
  return 0;
}
