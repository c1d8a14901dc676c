// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/status_command.h"

#include <algorithm>
#include <iomanip>
#include <memory>
#include <ostream>
#include <string>

#include "clients/cli/json_output.h"
#include "loci/v1/map_admin.pb.h"

namespace loci::cli {
namespace {

// However long the user would wait: a server that is up answers at once.
constexpr std::chrono::milliseconds kAnswerMax{1900};

void PrintMaps(const v1::ServerStatus& status, std::ostream& out) {
  out << (status.ready() ? "ready" : "not ready") << ", version " << status.version() << ", up "
      << std::fixed << std::setprecision(0) << status.uptime_s() << " s, " << status.maps_size()
      << (status.maps_size() == 1 ? " map\n" : " maps\n");
  for (const v1::ServerStatus::Map& map : status.maps()) {
    out << map.map() << ": ";
    // A map without a revision is not served, and its problem says why: it recovers, or is refused.
    // One that only takes no writes is read as ever.
    if (!map.problem().empty()) {
      out << map.problem() << (map.revision() == 0 ? "\n" : "\n  still read: ");
    }
    if (map.revision() == 0 && !map.problem().empty()) {
      continue;
    }
    const v1::CellsWritten& cells = map.cells_written();
    out << "revision " << map.revision() << ", " << map.events_waiting() << " events waiting, "
        << map.closures() << " closures, last closure " << std::setprecision(1)
        << map.last_closure_ms() << " ms (" << map.last_closure_places_moved()
        << " places moved, longest " << map.max_closure_ms() << " ms), chi2 "
        << std::setprecision(3) << map.chi2() << '\n'
        << "  cells written: integrate " << cells.integrate() << ", consolidate "
        << cells.consolidate() << ", remesh " << cells.remesh() << ", closure " << cells.closure()
        << '\n';
  }
}

Status Run(Context& context, const std::string& map) {
  v1::GetServerStatusRequest request;
  request.set_map(map);
  client::CallOptions options;
  options.timeout = std::min<std::chrono::microseconds>(context.timeout(), kAnswerMax);
  LOCI_ASSIGN_OR_RETURN(const v1::ServerStatus status,
                        context.channel()->Call<v1::ServerStatus>(
                            "loci.v1.MapAdmin/GetServerStatus", request, options));
  if (context.json()) {
    JsonWriter json;
    json.Value(status);
    context.out() << json.text() << '\n';
  } else {
    PrintMaps(status, context.out());
  }
  if (!status.ready()) {
    return UnavailableError("the server answers but is not ready yet");
  }
  return {};
}

}  // namespace

Command MakeStatusCommand() {
  auto map = std::make_shared<std::string>();
  Command command;
  command.name = "status";
  command.help =
      "Ask whether the server is ready, and how its maps are. Exit code 0 if it is ready; 3, "
      "within "
      "2 s, if it is not.";
  command.examples = "status\nstatus --map office --json";
  command.arguments = {{.name = "--map",
                        .target = map.get(),
                        .help = "Only this map; otherwise all",
                        .value_name = "MAP"}};
  command.run = [map](Context& context) { return Run(context, *map); };
  return command;
}

}  // namespace loci::cli
