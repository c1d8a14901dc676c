// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/map_command.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>
#include <ostream>
#include <string>

#include "clients/cli/json_output.h"
#include "loci/v1/map_admin.pb.h"

namespace loci::cli {
namespace {

struct CreateOptions {
  std::string map;
  std::optional<double> cell_size_m;
  std::optional<double> place_length_m;
  std::optional<double> range_max_m;
  std::optional<std::uint64_t> seed;
};

Status RunCreate(Context& context, const CreateOptions& options) {
  v1::CreateMapRequest request;
  request.set_map(options.map);
  v1::MapSettings& settings = *request.mutable_settings();
  if (options.cell_size_m.has_value()) {
    settings.set_cell_size_m(*options.cell_size_m);
  }
  if (options.place_length_m.has_value()) {
    settings.set_place_length_m(*options.place_length_m);
  }
  if (options.range_max_m.has_value()) {
    settings.set_range_max_m(*options.range_max_m);
  }
  if (options.seed.has_value()) {
    settings.set_seed(*options.seed);
  }
  LOCI_RETURN_IF_ERROR(
      context.Call<v1::CreateMapResponse>("loci.v1.MapAdmin/CreateMap", request).status());
  if (context.json()) {
    JsonWriter json;
    json.BeginObject().Key("map").Value(options.map).Key("created").Value(true).EndObject();
    context.out() << json.text() << '\n';
  } else {
    context.out() << "created map " << options.map << '\n';
  }
  return {};
}

Status RunList(Context& context) {
  LOCI_ASSIGN_OR_RETURN(
      const v1::ListMapsResponse maps,
      context.Call<v1::ListMapsResponse>("loci.v1.MapAdmin/ListMaps", v1::ListMapsRequest()));
  if (context.json()) {
    JsonWriter json;
    json.Value(maps);
    context.out() << json.text() << '\n';
    return {};
  }
  for (const v1::ListMapsResponse::Entry& entry : maps.maps()) {
    context.out() << entry.map() << "  ";
    if (entry.healthy()) {
      context.out() << "revision " << entry.revision() << '\n';
    } else {
      context.out() << entry.problem() << '\n';  // that it recovers, is refused, takes no writes
    }
  }
  return {};
}

void PrintInfo(const v1::MapInfo& info, std::ostream& out) {
  const v1::FileBytes& bytes = info.file_bytes();
  const v1::MapSettings& settings = info.settings();
  out << "map            " << info.map() << '\n'
      << "revision       " << info.revision() << '\n'
      << "last event     " << info.last_event() << '\n'
      << "state digest   " << info.state_digest() << '\n'
      << "sessions       " << info.sessions() << '\n'
      << "places         " << info.places() << '\n'
      << "landmarks      " << info.landmarks_ltm() << " LTM, " << info.landmarks_stm() << " STM\n"
      << "LTRs           " << info.ltrs() << '\n'
      << "closures       " << info.closures() << '\n'
      << "file           " << bytes.total() << " bytes: map " << bytes.map() << ", history "
      << bytes.history() << ", log " << bytes.log()
      << (bytes.map() == 0 && bytes.log() > 0 ? " (no checkpoint yet: all is in the log)\n" : "\n")
      << "settings       cell size " << settings.cell_size_m() << " m, place length "
      << settings.place_length_m() << " m, range " << settings.range_max_m() << " m, seed "
      << settings.seed() << '\n';
}

Status RunInfo(Context& context, const std::string& map) {
  LOCI_RETURN_IF_ERROR(context.AwaitMap(map));
  v1::GetMapInfoRequest request;
  request.set_map(map);
  LOCI_ASSIGN_OR_RETURN(const v1::MapInfo info,
                        context.Call<v1::MapInfo>("loci.v1.MapAdmin/GetMapInfo", request));
  if (context.json()) {
    JsonWriter json;
    json.Value(info);
    context.out() << json.text() << '\n';
  } else {
    PrintInfo(info, context.out());
  }
  return {};
}

Status RunDelete(Context& context, const std::string& map) {
  v1::DeleteMapRequest request;
  request.set_map(map);
  LOCI_RETURN_IF_ERROR(
      context.Call<v1::DeleteMapResponse>("loci.v1.MapAdmin/DeleteMap", request).status());
  if (context.json()) {
    JsonWriter json;
    json.BeginObject().Key("map").Value(map).Key("deleted").Value(true).EndObject();
    context.out() << json.text() << '\n';
  } else {
    context.out() << "deleted map " << map << '\n';
  }
  return {};
}

Status RunVerify(Context& context, const std::string& map) {
  LOCI_RETURN_IF_ERROR(context.AwaitMap(map));
  v1::VerifyMapRequest request;
  request.set_map(map);
  // A replay takes as long as the log is long: the usual timeout would be wrong here.
  constexpr std::chrono::hours kVerifyMax{1};
  client::CallOptions options;
  options.timeout = std::max<std::chrono::microseconds>(context.timeout(), kVerifyMax);
  LOCI_ASSIGN_OR_RETURN(const v1::VerifyMapResponse verified,
                        context.channel()->Call<v1::VerifyMapResponse>(
                            "loci.v1.MapAdmin/VerifyMap", request, options));
  if (context.json()) {
    JsonWriter json;
    json.BeginObject().Key("map").Value(map).Key("ok").Value(true).Fields(verified).EndObject();
    context.out() << json.text() << '\n';
  } else {
    context.out() << "map " << map << " is whole: " << verified.events_replayed()
                  << " events replayed from event " << verified.replayed_from() << " to "
                  << verified.last_event() << ", digest " << verified.state_digest() << '\n';
  }
  return {};
}

// A command whose only argument is the map.
template <typename Function>
Command MakeMapCommand(const std::string& verb, const std::string& help, Function run) {
  auto map = std::make_shared<std::string>();
  Command command;
  command.name = "map " + verb;
  command.help = help;
  command.examples = "map " + verb + " office\nmap " + verb + " office --json";
  command.arguments = {
      {.name = "MAP", .target = map.get(), .help = "Name of the map", .required = true}};
  command.run = [map, run](Context& context) { return run(context, *map); };
  return command;
}

Command MakeCreateCommand() {
  auto options = std::make_shared<CreateOptions>();
  Command command;
  command.name = "map create";
  command.help = "Make an empty map. Its settings never change afterwards.";
  command.examples = "map create office\nmap create hall --cell-size 0.1 --range-max 30";
  command.arguments = {{.name = "MAP",
                        .target = &options->map,
                        .help = "Its name: a to z, 0 to 9, - and _, at most 64 of them",
                        .required = true},
                       {.name = "--cell-size",
                        .target = &options->cell_size_m,
                        .help = "Side of a cell of the layers, 0.01 to 1 (default 0.05)",
                        .value_name = "M"},
                       {.name = "--place-length",
                        .target = &options->place_length_m,
                        .help = "A place ends after this distance driven, 1 to 100 (default 5)",
                        .value_name = "M"},
                       {.name = "--range-max",
                        .target = &options->range_max_m,
                        .help = "Readings beyond this are not used, 1 to 65 (default 15)",
                        .value_name = "M"},
                       {.name = "--seed",
                        .target = &options->seed,
                        .help = "Part of the seed of the map's random numbers (default 0)"}};
  command.run = [options](Context& context) { return RunCreate(context, *options); };
  return command;
}

}  // namespace

std::vector<Command> MakeMapCommands() {
  Command list;
  list.name = "map list";
  list.help = "List the maps of the server.";
  list.examples = "map list\nmap list --json";
  list.run = RunList;
  return {MakeCreateCommand(),
          std::move(list),
          MakeMapCommand("info", "Show what a map holds, its revision and its digest.", RunInfo),
          MakeMapCommand("delete", "Delete a map and all its history, for ever.", RunDelete),
          MakeMapCommand("verify",
                         "Read all of a map's file, check all checksums and references, replay its "
                         "log and compare the digest.",
                         RunVerify)};
}

}  // namespace loci::cli
