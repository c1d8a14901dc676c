// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/export_command.h"

#include <memory>
#include <ostream>
#include <string>

#include "clients/cli/grid_file.h"
#include "clients/cli/json_output.h"
#include "clients/cli/map_fetch.h"
#include "clients/cli/text_output.h"

namespace loci::cli {
namespace {

struct ExportOptions {
  std::string map;
  std::string out;
  std::string session;
  std::string format = "tum";
  std::string layer = "occupancy";
  double resolution_m = 0.0;
  std::uint64_t revision = 0;
};

Status RunTrajectory(Context& context, const ExportOptions& options) {
  LOCI_ASSIGN_OR_RETURN(const Trajectory trajectory,
                        FetchTrajectory(context, options.map, options.session, options.revision));
  std::string text;
  for (const v1::StampedPose& pose : trajectory.poses) {
    const v1::Pose2& map_from_robot = pose.map_from_robot();
    text +=
        TumLine(pose.stamp_ns(), {map_from_robot.x(), map_from_robot.y(), map_from_robot.theta()}) +
        '\n';
  }
  LOCI_RETURN_IF_ERROR(WriteFile(options.out, text));
  if (context.json()) {
    JsonWriter json;
    json.BeginObject().Key("out").Value(options.out);
    json.Key("poses").Value(std::uint64_t{trajectory.poses.size()});
    json.Key("revision").Value(trajectory.revision).EndObject();
    context.out() << json.text() << '\n';
  } else {
    context.out() << "wrote " << trajectory.poses.size() << " poses of revision "
                  << trajectory.revision << " to " << options.out << '\n';
  }
  return {};
}

OccupancyMap OccupancyOf(const Raster& raster) {
  OccupancyMap map;
  map.x_min_m = raster.x_min_m;
  map.y_min_m = raster.y_min_m;
  map.resolution_m = raster.resolution_m;
  map.width = raster.width;
  map.height = raster.height;
  map.cells.reserve(raster.cells.size());
  for (const std::int8_t cell : raster.cells) {
    // More likely than not decides: what was seen once as free is free for a planner. Even odds
    // tell as little as no observation.
    const bool unknown = cell == Raster::kUnobserved || cell == 0;
    map.cells.push_back(unknown    ? OccupancyMap::Cell::kUnknown
                        : cell > 0 ? OccupancyMap::Cell::kOccupied
                                   : OccupancyMap::Cell::kFree);
  }
  return map;
}

Status RunGrid(Context& context, const ExportOptions& options) {
  LOCI_ASSIGN_OR_RETURN(const Raster raster,
                        FetchRaster(context,
                                    {.map = options.map,
                                     .layer = options.layer,
                                     .resolution_m = options.resolution_m,
                                     .revision = options.revision}));
  LOCI_RETURN_IF_ERROR(WriteGridFile(options.out, OccupancyOf(raster)));
  if (context.json()) {
    JsonWriter json;
    json.BeginObject().Key("out").Value(options.out);
    json.Key("width").Value(std::int64_t{raster.width});
    json.Key("height").Value(std::int64_t{raster.height});
    json.Key("resolution_m").Value(raster.resolution_m);
    json.Key("revision").Value(raster.revision).EndObject();
    context.out() << json.text() << '\n';
  } else {
    context.out() << "wrote " << raster.width << " x " << raster.height << " cells of "
                  << NumberText(raster.resolution_m) << " m, revision " << raster.revision
                  << ", to " << options.out << " (PGM and YAML)\n";
  }
  return {};
}

std::vector<Argument> CommonArguments(ExportOptions& options, const std::string& out_help) {
  return {{.name = "--map",
           .target = &options.map,
           .help = "Name of the map",
           .required = true,
           .value_name = "MAP"},
          {.name = "--out",
           .target = &options.out,
           .help = out_help,
           .required = true,
           .value_name = "FILE"},
          {.name = "--revision",
           .target = &options.revision,
           .help = "Of this revision, while the server keeps it (default: the newest)"}};
}

Command MakeTrajectoryCommand() {
  auto options = std::make_shared<ExportOptions>();
  Command command;
  command.name = "export trajectory";
  command.help =
      "Write the robots' poses in the frame map, one per accepted scan, ordered by stamp.";
  command.examples =
      "export trajectory --map intel --out intel.tum\n"
      "export trajectory --map office --session r1-1 --out r1.tum";
  command.arguments = CommonArguments(*options, "The file to write");
  command.arguments.push_back({.name = "--session",
                               .target = &options->session,
                               .help = "Only this session (default: all)",
                               .value_name = "NAME"});
  command.arguments.push_back({.name = "--format",
                               .target = &options->format,
                               .help = "tum: stamp x y z qx qy qz qw",
                               .value_name = "tum",
                               .choices = {"tum"}});
  command.run = [options](Context& context) { return RunTrajectory(context, *options); };
  return command;
}

Command MakeGridCommand() {
  auto options = std::make_shared<ExportOptions>();
  Command command;
  command.name = "export grid";
  command.help =
      "Write a layer as a grid for planners: map_server's PGM and YAML, as nav2 reads them. "
      "Occupied and free are what is more likely than not.";
  command.examples =
      "export grid --map office --out office.yaml\n"
      "export grid --map office --out office.yaml --resolution 0.1";
  command.arguments =
      CommonArguments(*options, "NAME.yaml; the picture is written beside it as NAME.pgm");
  command.arguments.push_back({.name = "--layer",
                               .target = &options->layer,
                               .help = "The layer (default occupancy)",
                               .value_name = "LAYER"});
  command.arguments.push_back({.name = "--resolution",
                               .target = &options->resolution_m,
                               .help = "Side of a cell (default: the layer's)",
                               .value_name = "M"});
  command.run = [options](Context& context) { return RunGrid(context, *options); };
  return command;
}

}  // namespace

std::vector<Command> MakeExportCommands() {
  return {MakeTrajectoryCommand(), MakeGridCommand()};
}

}  // namespace loci::cli
