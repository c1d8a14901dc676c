// SPDX-License-Identifier: Apache-2.0
// The whole pipeline without the wire and the disk: a CARMEN log goes straight into an engine.
//
//   map_log LOG [--relations FILE] [--out TRAJECTORY.tum] [--place-length M] [--seed N]
//   [--closures]
//
// Prints one line: scans, seconds, real-time factor, places, closures, cells written by
// integration, consolidation and remeshing, and the relations error. bench/accuracy.sh makes a
// table of it.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iomanip>
#include <string>

#include "bench/map_of_log.h"
#include "bench/relations.h"

namespace loci {
namespace {

struct Arguments {
  std::string log;
  std::string relations;
  std::string out;
  MapOfLogOptions options;
  bool closures = false;
};

void WriteTrajectory(const Snapshot& snapshot, const std::string& path) {
  std::ofstream out(path);
  out << std::fixed << std::setprecision(9);
  for (const StampedPose& pose : PosesOf(snapshot)) {
    out << pose.stamp_s << ' ' << pose.pose.x << ' ' << pose.pose.y << " 0 0 0 "
        << std::sin(pose.pose.theta / 2) << ' ' << std::cos(pose.pose.theta / 2) << '\n';
  }
}

void PrintClosures(const Snapshot& snapshot) {
  for (const ClosureSnapshot& closure : *snapshot.closures) {
    std::printf(
        "closure %u %u %d correction %.3f m, chi2 %.2f, alike %.2f, overlap %.0f m2, "
        "free %.3f, sigma %.3f %.3f %.4f: %s\n",
        closure.from.value,
        closure.to.value,
        static_cast<int>(closure.state),
        closure.correction_m,
        closure.chi2,
        closure.hausdorff_fraction,
        closure.overlap_m2,
        closure.free_conflict_fraction,
        std::sqrt(closure.covariance(0, 0)),
        std::sqrt(closure.covariance(1, 1)),
        std::sqrt(closure.covariance(2, 2)),
        closure.reason.c_str());
  }
}

void PrintSummary(const MappedLog& mapped, double seconds) {
  const Snapshot& snapshot = *mapped.snapshot;
  const auto number = [](std::uint64_t value) { return static_cast<unsigned long long>(value); };
  std::printf("scans %llu seconds %.2f factor %.1f places %zu closures %u of %zu overlays %zu ",
              number(mapped.scan_count),
              seconds,
              mapped.log_seconds / seconds,
              snapshot.places.size(),
              snapshot.closures_accepted,
              snapshot.closures->size(),
              snapshot.overlays.size());
  std::printf("ltrs %zu cells %llu %llu %llu digest %s",
              snapshot.mesh->ltrs.size(),
              number(snapshot.cells_written.integrate),
              number(snapshot.cells_written.consolidate),
              number(snapshot.cells_written.remesh),
              mapped.state_digest.ToHex().c_str());
}

Status Run(const Arguments& arguments) {
  const auto begin = std::chrono::steady_clock::now();
  LOCI_ASSIGN_OR_RETURN(const MappedLog mapped, MapOfLog(arguments.log, arguments.options));
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (!arguments.out.empty()) {
    WriteTrajectory(*mapped.snapshot, arguments.out);
  }
  if (arguments.closures) {
    PrintClosures(*mapped.snapshot);
  }
  PrintSummary(mapped, seconds);
  if (!arguments.relations.empty()) {
    const RelationsError error =
        ErrorOf(PosesOf(*mapped.snapshot), ReadRelations(arguments.relations));
    std::printf(" relations %zu unmatched %zu mean %.4f m %.3f deg max %.3f m %.2f deg",
                error.matched,
                error.unmatched,
                error.mean_m,
                error.mean_deg,
                error.max_m,
                error.max_deg);
  }
  std::printf("\n");
  return {};
}

}  // namespace
}  // namespace loci

int main(int argc, char** argv) {
  loci::Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const char* value = i + 1 < argc ? argv[i + 1] : "";
    if (word == "--out") {
      arguments.out = value;
      ++i;
    } else if (word == "--relations") {
      arguments.relations = value;
      ++i;
    } else if (word == "--place-length") {
      arguments.options.settings.place_length_m = std::atof(value);
      ++i;
    } else if (word == "--seed") {
      arguments.options.settings.seed = std::strtoull(value, nullptr, 10);
      ++i;
    } else if (word == "--closures") {
      arguments.closures = true;
    } else {
      arguments.log = word;
    }
  }
  if (arguments.log.empty()) {
    std::fprintf(stderr,
                 "usage: map_log LOG [--relations FILE] [--out TRAJECTORY.tum] "
                 "[--place-length M] [--seed N] [--closures]\n");
    return 2;
  }
  if (const loci::Status status = loci::Run(arguments); !status.ok()) {
    std::fprintf(stderr, "%s\n", status.ToString().c_str());
    return 1;
  }
  return 0;
}
