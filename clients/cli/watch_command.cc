// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/watch_command.h"

#include <memory>
#include <ostream>
#include <string>

#include "clients/cli/json_output.h"
#include "loci/v1/watch.pb.h"

namespace loci::cli {
namespace {

struct WatchOptions {
  std::string map;
  std::uint64_t count = 0;
};

void Print(Context& context, const v1::MapChange& change) {
  if (context.json()) {
    JsonWriter json;
    json.Value(change);
    context.out() << json.text() << std::endl;
    return;
  }
  context.out() << "revision " << change.revision() << ": " << change.dirty_tiles_size()
                << " dirty tiles, " << change.closures() << " closures";
  if (change.everything_moved()) {
    context.out() << ", everything moved";
  }
  for (const v1::SessionState& session : change.sessions()) {
    const v1::Pose2& pose = session.map_from_robot();
    context.out() << "; " << session.session() << (session.open() ? " at (" : " closed at (")
                  << pose.x() << ", " << pose.y() << ", " << pose.theta() << ")";
  }
  context.out() << std::endl;
}

Status Run(Context& context, const WatchOptions& options) {
  LOCI_RETURN_IF_ERROR(context.AwaitMap(options.map));
  v1::WatchMapRequest request;
  request.set_map(options.map);
  auto stream = context.channel()->Stream<v1::MapChange>("loci.v1.Watch/WatchMap", request);
  v1::MapChange change;
  for (std::uint64_t seen = 0; (options.count == 0 || seen < options.count) && stream.Next(change);
       ++seen) {
    Print(context, change);
    if (seen + 1 == options.count) {
      return {};
    }
  }
  return stream.status();
}

}  // namespace

Command MakeWatchCommand() {
  auto options = std::make_shared<WatchOptions>();
  Command command;
  command.name = "watch";
  command.help =
      "Follow a map: one line per published revision, until Ctrl-C. With --json, one object a "
      "line.";
  command.examples = "watch --map office\nwatch --map office --json --count 1";
  command.arguments = {{.name = "--map",
                        .target = &options->map,
                        .help = "Name of the map",
                        .required = true,
                        .value_name = "MAP"},
                       {.name = "--count",
                        .target = &options->count,
                        .help = "End after this many revisions (default: never)"}};
  command.run = [options](Context& context) { return Run(context, *options); };
  return command;
}

}  // namespace loci::cli
