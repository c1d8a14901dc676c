// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/query_command.h"

#include <memory>
#include <ostream>
#include <string>

#include "clients/cli/call_command.h"
#include "clients/cli/json_output.h"
#include "clients/cli/text_output.h"
#include "loci/v1/map_query.pb.h"

namespace loci::cli {
namespace {

struct TileOptions {
  std::string map;
  std::string layer = "occupancy";
  std::uint64_t zoom = 0;
  std::int64_t x = 0;
  std::int64_t y = 0;
  std::string out;
  std::uint64_t revision = 0;
};

// The wire has 32 bits; what does not fit is out of the server's bounds too.
template <typename To, typename From>
StatusOr<To> Narrow(const char* field, From value) {
  const To narrow = static_cast<To>(value);
  if (static_cast<From>(narrow) != value) {
    return OutOfRangeError(std::string(field) + ": " + std::to_string(value) +
                           " is no index of a tile");
  }
  return narrow;
}

Status RunTile(Context& context, const TileOptions& options) {
  v1::GetTileRequest request;
  request.set_map(options.map);
  request.set_layer(options.layer);
  LOCI_ASSIGN_OR_RETURN(const std::uint32_t zoom, Narrow<std::uint32_t>("Z", options.zoom));
  LOCI_ASSIGN_OR_RETURN(const std::int32_t x, Narrow<std::int32_t>("X", options.x));
  LOCI_ASSIGN_OR_RETURN(const std::int32_t y, Narrow<std::int32_t>("Y", options.y));
  request.set_zoom(zoom);
  request.set_x(x);
  request.set_y(y);
  request.set_revision(options.revision);
  LOCI_RETURN_IF_ERROR(context.AwaitMap(options.map));
  LOCI_ASSIGN_OR_RETURN(const v1::Tile tile,
                        context.Call<v1::Tile>("loci.v1.MapQuery/GetTile", request));
  LOCI_RETURN_IF_ERROR(WriteFile(options.out, tile.png()));
  if (context.json()) {
    JsonWriter json;
    json.BeginObject().Key("out").Value(options.out);
    json.Key("revision").Value(std::uint64_t{tile.revision()});
    json.Key("size_bytes").Value(std::uint64_t{tile.png().size()}).EndObject();
    context.out() << json.text() << '\n';
  } else {
    context.out() << "wrote tile " << tile.zoom() << '/' << tile.x() << '/' << tile.y()
                  << " of revision " << tile.revision() << " to " << options.out << '\n';
  }
  return {};
}

}  // namespace

Command MakeTileCommand() {
  auto options = std::make_shared<TileOptions>();
  Command command;
  command.name = "tile";
  command.help =
      "Write one tile as PNG. At zoom 0 a tile is 3276.8 m wide, every zoom halves it; tile 0 0 "
      "has "
      "its lower left corner at the map's origin, x grows right, y grows up.";
  command.examples = "tile --map office 8 0 -1 --out t.png";
  command.arguments = {
      {.name = "--map",
       .target = &options->map,
       .help = "Name of the map",
       .required = true,
       .value_name = "MAP"},
      {.name = "--layer",
       .target = &options->layer,
       .help = "The layer (default occupancy)",
       .value_name = "LAYER"},
      {.name = "Z", .target = &options->zoom, .help = "Zoom, 0 to 24", .required = true},
      {.name = "X", .target = &options->x, .help = "Column", .required = true},
      {.name = "Y", .target = &options->y, .help = "Row", .required = true},
      {.name = "--out",
       .target = &options->out,
       .help = "The file to write",
       .required = true,
       .value_name = "FILE"},
      {.name = "--revision",
       .target = &options->revision,
       .help = "Of this revision, while the server keeps it (default: the newest)"}};
  command.run = [options](Context& context) { return RunTile(context, *options); };
  return command;
}

Command MakeCallCommand() {
  auto arguments = std::make_shared<CallArguments>();
  Command command;
  command.name = "call";
  command.help =
      "Call any method of the server with a request in JSON. Without a method, list what there is.";
  command.examples =
      "call\ncall loci.v1.MapAdmin/GetMapInfo -d '{\"map\": \"office\"}'\n"
      "call loci.v1.Health/Check";
  command.arguments = {{.name = "METHOD",
                        .target = &arguments->method,
                        .help = "PACKAGE.SERVICE/METHOD, or a service whose methods are listed"},
                       {.name = "-d,--data",
                        .target = &arguments->json,
                        .help = "The request (default {})",
                        .value_name = "JSON"}};
  command.run = [arguments](Context& context) {
    arguments->compact = context.json();
    arguments->options.timeout = context.timeout();
    return RunCall(*context.channel(), *arguments, context.out());
  };
  return command;
}

}  // namespace loci::cli
