// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/session_command.h"

#include <memory>
#include <ostream>
#include <string>

#include "clients/cli/json_output.h"
#include "clients/cli/text_output.h"
#include "loci/v1/mapping.pb.h"

namespace loci::cli {
namespace {

void PrintJson(const v1::ListSessionsResponse& sessions, std::ostream& out) {
  JsonWriter json;
  json.BeginObject().Key("sessions").BeginArray();
  for (const v1::SessionState& session : sessions.sessions()) {
    json.BeginObject();
    json.Key("state").Value(session.open() ? "open" : "closed");
    json.Fields(session).EndObject();
  }
  json.EndArray().EndObject();
  out << json.text() << '\n';
}

void PrintText(const v1::ListSessionsResponse& sessions, std::ostream& out) {
  for (const v1::SessionState& session : sessions.sessions()) {
    out << session.session() << "  robot " << session.robot() << ", "
        << (session.open() ? "open" : "closed") << ", " << session.accepted_count()
        << " observations accepted, " << session.refused_count() << " refused";
    if (session.accepted_count() > 0) {
      out << ", stamps " << StampText(session.first_stamp_ns()) << " to "
          << StampText(session.last_stamp_ns());
    }
    out << '\n';
  }
}

Status Run(Context& context, const std::string& map) {
  LOCI_RETURN_IF_ERROR(context.AwaitMap(map));
  v1::ListSessionsRequest request;
  request.set_map(map);
  LOCI_ASSIGN_OR_RETURN(
      const v1::ListSessionsResponse sessions,
      context.Call<v1::ListSessionsResponse>("loci.v1.Mapping/ListSessions", request));
  if (context.json()) {
    PrintJson(sessions, context.out());
  } else {
    PrintText(sessions, context.out());
  }
  return {};
}

}  // namespace

Command MakeSessionListCommand() {
  auto map = std::make_shared<std::string>();
  Command command;
  command.name = "session list";
  command.help = "List a map's sessions: robot, state, stamps, observations accepted and refused.";
  command.examples = "session list --map office\nsession list --map office --json";
  command.arguments = {{.name = "--map",
                        .target = map.get(),
                        .help = "Name of the map",
                        .required = true,
                        .value_name = "MAP"}};
  command.run = [map](Context& context) { return Run(context, *map); };
  return command;
}

}  // namespace loci::cli
