// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/stream_command.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <memory>
#include <ostream>
#include <string>
#include <thread>

#include "clients/cli/json_output.h"
#include "clients/cli/log_player.h"
#include "clients/cli/progress_bar.h"
#include "clients/cli/text_output.h"
#include "clients/cpp/mapping_session.h"
#include "clients/log/carmen_reader.h"
#include "loci/v1/map_admin.pb.h"
#include "loci/v1/mapping.pb.h"

namespace loci::cli {
namespace {

using Clock = std::chrono::steady_clock;

struct StreamOptions {
  std::string log;
  std::string map;
  std::string robot = "robot";
  std::optional<std::string> session;
  std::string speed = "max";
  std::optional<std::string> start;
  std::uint64_t batch = 64;
  double retry_for_s = 60.0;
  std::string on_error = "stop";
};

// Nothing for "max".
std::optional<double> SpeedOf(const std::string& text) {
  double speed = 0.0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, speed);
  return error == std::errc() && stop == end && speed > 0.0 && speed <= 1e6
             ? std::optional<double>(speed)
             : std::nullopt;
}

std::string CheckSpeed(const std::string& text) {
  return text == "max" || SpeedOf(text).has_value()
             ? ""
             : "\"" + text + "\": must be max or a number above 0, for example 10";
}

// Calls until the server has answered or `retry_for` is over. Only for calls that may be repeated.
template <typename Response>
StatusOr<Response> CallPatiently(Context& context,
                                 const StreamOptions& options,
                                 std::string_view method,
                                 const google::protobuf::MessageLite& request) {
  const auto patience = std::chrono::duration_cast<std::chrono::microseconds>(
      std::chrono::duration<double>(options.retry_for_s));
  const auto end = Clock::now() + patience;
  while (true) {
    const auto left = std::chrono::duration_cast<std::chrono::microseconds>(end - Clock::now());
    client::CallOptions call;
    call.wait_for_ready = left.count() > 0;
    call.timeout = left.count() > 0 ? std::min(left, context.timeout())
                                    : std::chrono::microseconds(context.timeout());
    StatusOr<Response> response = context.channel()->Call<Response>(method, request, call);
    const StatusCode code = response.status().code();
    if ((code != StatusCode::kUnavailable && code != StatusCode::kDeadlineExceeded) ||
        Clock::now() >= end) {
      return response;
    }
    // The channel backs off by itself while it connects; this is for a server that says "not yet".
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
}

// Whether the map was made now.
StatusOr<bool> EnsureMap(Context& context, const StreamOptions& options) {
  v1::CreateMapRequest request;
  request.set_map(options.map);
  const Status status =
      CallPatiently<v1::CreateMapResponse>(context, options, "loci.v1.MapAdmin/CreateMap", request)
          .status();
  if (status.code() == StatusCode::kAlreadyExists) {
    return false;
  }
  LOCI_RETURN_IF_ERROR(status);
  return true;
}

StatusOr<std::string> ChooseSession(Context& context, const StreamOptions& options) {
  if (options.session.has_value()) {
    return *options.session;
  }
  v1::ListSessionsRequest request;
  request.set_map(options.map);
  LOCI_ASSIGN_OR_RETURN(const v1::ListSessionsResponse sessions,
                        (CallPatiently<v1::ListSessionsResponse>(
                            context, options, "loci.v1.Mapping/ListSessions", request)));
  const auto taken = [&](const std::string& name) {
    return std::any_of(sessions.sessions().begin(), sessions.sessions().end(), [&](const auto& s) {
      return s.session() == name;
    });
  };
  auto number = 1 + std::count_if(sessions.sessions().begin(),
                                  sessions.sessions().end(),
                                  [&](const auto& s) { return s.robot() == options.robot; });
  while (taken(options.robot + "-" + std::to_string(number))) {
    ++number;
  }
  return options.robot + "-" + std::to_string(number);
}

client::MappingSessionOptions SessionOptionsOf(const StreamOptions& options,
                                               const std::string& session,
                                               ProgressBar& bar) {
  client::MappingSessionOptions result;
  result.map = options.map;
  result.session = session;
  result.robot = options.robot;
  result.batch_observations_max = options.batch;
  result.retry_for =
      std::chrono::milliseconds(static_cast<std::int64_t>(options.retry_for_s * 1e3));
  result.on_trouble = [&bar](const std::string& what) { bar.Print("loci stream: " + what); };
  if (options.start.has_value()) {
    const Pose2 start = ParsePose(*options.start).value();  // checked with the arguments
    result.map_from_start.emplace();
    result.map_from_start->set_x(start.x);
    result.map_from_start->set_y(start.y);
    result.map_from_start->set_theta(start.theta);
  }
  return result;
}

struct Summary {
  std::string session;
  bool map_created = false;
  PlayerFigures figures;
  std::size_t skipped_lines = 0;
  std::size_t duplicates = 0;
  std::uint64_t interruptions = 0;
  double seconds = 0.0;
  double log_seconds = 0.0;
  v1::SessionState state;
};

void Print(Context& context, const StreamOptions& options, const Summary& summary) {
  const double factor = summary.seconds > 0.0 ? summary.log_seconds / summary.seconds : 0.0;
  const PlayerFigures& figures = summary.figures;
  if (context.json()) {
    JsonWriter json;
    json.BeginObject();
    json.Key("map").Value(options.map).Key("map_created").Value(summary.map_created);
    json.Key("session").Value(summary.session).Key("robot").Value(options.robot);
    json.Key("scans_sent").Value(std::uint64_t{figures.sent});
    json.Key("scans_passed_over").Value(std::uint64_t{figures.passed_over});
    json.Key("accepted").Value(std::uint64_t{summary.state.accepted_count()});
    json.Key("refused").Value(std::uint64_t{summary.state.refused_count()});
    json.Key("moved").Value(std::uint64_t{figures.moved});
    json.Key("late").Value(std::uint64_t{figures.late});
    json.Key("skipped_lines").Value(std::uint64_t{summary.skipped_lines});
    json.Key("duplicates").Value(std::uint64_t{summary.duplicates});
    json.Key("interruptions").Value(std::uint64_t{summary.interruptions});
    json.Key("last_durable_number").Value(std::uint64_t{summary.state.last_durable_number()});
    json.Key("last_applied_number").Value(std::uint64_t{summary.state.last_applied_number()});
    json.Key("revision").Value(std::uint64_t{summary.state.revision()});
    json.Key("seconds").Value(summary.seconds).Key("log_seconds").Value(summary.log_seconds);
    json.Key("real_time_factor").Value(factor).EndObject();
    context.out() << json.text() << '\n';
    return;
  }
  std::ostream& out = context.out();
  out << "session " << summary.session << ": " << figures.sent << " scans sent";
  if (figures.passed_over > 0) {
    out << " (" << figures.passed_over << " were there already)";
  }
  out << ", " << summary.state.accepted_count() << " accepted, " << summary.state.refused_count()
      << " refused, " << figures.moved << " moved into order";
  if (figures.late > 0) {
    out << ", " << figures.late << " too late for that";
  }
  if (summary.skipped_lines > 0) {
    out << ", " << summary.skipped_lines << " damaged lines skipped";
  }
  out << "; all durable and applied at revision " << summary.state.revision() << ".\n"
      << FixedText(summary.log_seconds, 1) << " s of log in " << FixedText(summary.seconds, 2)
      << " s: real-time factor " << FixedText(factor, 1);
  if (summary.interruptions > 0) {
    out << "; " << summary.interruptions << " interruptions outlived";
  }
  out << '\n';
}

// Plays the log and closes the session.
Status Play(Context& context,
            const StreamOptions& options,
            CarmenReader& reader,
            ProgressBar& bar,
            Summary& summary) {
  LOCI_ASSIGN_OR_RETURN(const std::unique_ptr<client::MappingSession> session,
                        client::MappingSession::Open(
                            context.channel(), SessionOptionsOf(options, summary.session, bar)));
  if (session->next_number() > 1) {
    bar.Print("loci stream: going on with session " + summary.session + " after observation " +
              std::to_string(session->next_number() - 1));
  }
  LogPlayer player(reader, *session, SpeedOf(options.speed));
  const Clock::time_point begin = Clock::now();
  const Status played = player.Play([&](const PlayerFigures& figures) {
    const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
    bar.Show(figures.passed_over + figures.sent,
             reader.scan_count(),
             FixedText(static_cast<double>(figures.sent) / std::max(seconds, 1e-3), 0) +
                 " scans/s, durable " + std::to_string(session->progress().last_durable_number));
  });
  summary.figures = player.figures();
  summary.skipped_lines = reader.skipped_count();
  summary.duplicates = reader.duplicate_count();
  if (!played.ok()) {
    IgnoreError(session->Flush(), "the first error is the one to tell");
    return Status(played.code(),
                  played.message() + "\n  session " + summary.session + " stays open with " +
                      std::to_string(session->progress().last_durable_number) +
                      " durable observations; go on with --session " + summary.session);
  }
  bar.Show(reader.scan_count(), reader.scan_count(), "waiting until all is in the map");
  LOCI_ASSIGN_OR_RETURN(summary.state, session->Close());
  summary.interruptions = session->progress().interruptions;
  return {};
}

Status Run(Context& context, const StreamOptions& options) {
  CarmenReaderOptions reader_options;
  reader_options.on_error = options.on_error == "skip" ? CarmenReaderOptions::OnError::kSkip
                                                       : CarmenReaderOptions::OnError::kStop;
  LOCI_ASSIGN_OR_RETURN(const std::unique_ptr<CarmenReader> reader,
                        CarmenReader::Open(options.log, reader_options));
  const Clock::time_point begin = Clock::now();
  Summary summary;
  {
    ProgressBar bar(context.error(), context.terminal(), options.map);
    LOCI_ASSIGN_OR_RETURN(summary.map_created, EnsureMap(context, options));
    if (summary.map_created) {
      bar.Print("loci stream: made map " + options.map);
    }
    LOCI_ASSIGN_OR_RETURN(summary.session, ChooseSession(context, options));
    LOCI_RETURN_IF_ERROR(Play(context, options, *reader, bar, summary));
  }
  summary.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  summary.log_seconds =
      static_cast<double>(reader->last_stamp_ns() - reader->first_stamp_ns()) * 1e-9;
  Print(context, options, summary);
  return {};
}

std::vector<Argument> ArgumentsOf(StreamOptions& options) {
  return {{.name = "LOG",
           .target = &options.log,
           .help = "The log: CARMEN's format, plain, gzip or bzip2",
           .required = true},
          {.name = "--map",
           .target = &options.map,
           .help = "Name of the map; it is made if there is none",
           .required = true,
           .value_name = "MAP"},
          {.name = "--robot",
           .target = &options.robot,
           .help = "Name of the robot (default robot)",
           .value_name = "NAME"},
          {.name = "--session",
           .target = &options.session,
           .help = "Name of the session; an open one goes on where it stopped. Default: ROBOT-K, K "
                   "counting the robot's sessions in the map",
           .value_name = "NAME"},
          {.name = "--speed",
           .target = &options.speed,
           .help = "How many times faster than real time; max: as fast as the server takes it",
           .value_name = "X|max",
           .check = CheckSpeed},
          {.name = "--start",
           .target = &options.start,
           .help = "The robot's pose in the map at the beginning (default 0,0,0)",
           .value_name = "X,Y,THETA",
           .check = CheckPose},
          {.name = "--batch",
           .target = &options.batch,
           .help = "Observations in one message, 1 to 1024 (default 64)",
           .check =
               [](const std::string& text) {
                 const std::optional<double> count = SpeedOf(text);
                 return count.has_value() && *count >= 1.0 && *count <= 1024.0
                            ? std::string()
                            : "\"" + text + "\": must be from 1 to 1024";
               }},
          {.name = "--retry-for",
           .target = &options.retry_for_s,
           .help = "How long to try again while the server is away, in seconds (default 60)",
           .value_name = "S",
           .check =
               [](const std::string& text) {
                 return text == "0" || SpeedOf(text).has_value()
                            ? std::string()
                            : "\"" + text + "\": must be from 0 to 1000000";
               }},
          {.name = "--on-error",
           .target = &options.on_error,
           .help = "What a damaged line of the log does (default stop)",
           .value_name = "stop|skip",
           .choices = {"stop", "skip"}}};
}

}  // namespace

Command MakeStreamCommand() {
  auto options = std::make_shared<StreamOptions>();
  Command command;
  command.name = "stream";
  command.help =
      "Play a log to the server as a robot would. Scans are put in order of stamp within 2 s. "
      "Outlives restarts of the server. Exit code 0 only if every observation is durable and "
      "applied.";
  command.examples =
      "stream intel.clf.bz2 --map intel\n"
      "stream day2.clf.gz --map office --robot r2 --speed 10 --start 3.5,-2,1.57\n"
      "stream intel.clf.bz2 --map intel --session robot-1   (goes on after a kill)";
  command.arguments = ArgumentsOf(*options);
  command.run = [options](Context& context) { return Run(context, *options); };
  return command;
}

}  // namespace loci::cli
