// SPDX-License-Identifier: Apache-2.0
// Reads a graph, optimises it, writes it in g2o's present records and says what it cost.
#include "clients/cli/offline/graph_command.h"

#include <array>
#include <chrono>
#include <memory>
#include <ostream>
#include <string>
#include <string_view>
#include <utility>

#include "clients/cli/json_output.h"
#include "clients/cli/text_output.h"
#include "clients/log/line_source.h"
#include "core/graph/g2o_format.h"
#include "core/graph/optimize.h"
#include "core/graph/space_problem.h"
#include "core/graph/toro_optimizer.h"
#include "core/graph/toro_tree.h"

namespace loci::cli {
namespace {

// Valleys with a bent floor need many steps; a step costs milliseconds.
constexpr int kIterationsMax = 1000;
constexpr std::size_t kFileBytesMax = std::size_t{1} << 31U;

struct OptimizeArguments {
  std::string in;
  std::string out;
  std::string method = "auto";
  std::uint64_t sweeps = 100;
};

struct Outcome {
  OptimizationSummary summary;
  std::string start = "given";
};

double SecondsSince(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

StatusOr<std::string> ReadFile(const std::string& path) {
  LOCI_ASSIGN_OR_RETURN(const std::unique_ptr<ByteSource> source, OpenByteSource(path));
  std::string text;
  std::array<char, 1U << 16U> chunk{};
  while (true) {
    LOCI_ASSIGN_OR_RETURN(const std::size_t count, source->Read(chunk.data(), chunk.size()));
    if (count == 0) {
      return text;
    }
    if (text.size() + count > kFileBytesMax) {
      return ResourceExhaustedError(path + ": larger than " + std::to_string(kFileBytesMax) +
                                    " bytes");
    }
    text.append(chunk.data(), count);
  }
}

SparseOptions SparseOptionsOf(std::string_view method) {
  SparseOptions options;
  options.iterations_max = kIterationsMax;
  if (method == "levenberg-marquardt") {
    options.method = SparseOptions::Method::kLevenbergMarquardt;
  }
  return options;
}

// Descent alone, from the better of the given poses and the tree's.
Outcome OptimizeByToro(std::uint64_t sweeps, PoseGraph& graph) {
  Outcome outcome;
  outcome.summary.chi2_before = Chi2(graph);
  PoseGraph by_tree = graph;
  PlaceByTree(BreadthFirstTree(graph), by_tree);
  if (Chi2(by_tree) < outcome.summary.chi2_before) {
    graph = std::move(by_tree);
    outcome.start = "tree";
  }
  ToroOptimizer toro(graph);
  for (std::uint64_t i = 0; i < sweeps; ++i) {
    toro.Sweep();
  }
  graph.map_from_node = toro.Poses();
  PlacePoints(graph);
  outcome.summary.iterations = static_cast<int>(sweeps);
  outcome.summary.chi2_after = Chi2(graph);
  return outcome;
}

StatusOr<Outcome> OptimizePlane(const OptimizeArguments& arguments, PoseGraph& graph) {
  if (arguments.method == "toro") {
    return OptimizeByToro(arguments.sweeps, graph);
  }
  const SparseOptions options = SparseOptionsOf(arguments.method);
  if (arguments.method == "auto") {
    LOCI_ASSIGN_OR_RETURN(const BestStartSummary best, OptimizeFromBestStart(graph, options));
    return Outcome{best.optimization, std::string(GraphStartName(best.start))};
  }
  return Outcome{OptimizeSparse(graph, options), "given"};
}

StatusOr<Outcome> OptimizeSpace(const OptimizeArguments& arguments, SpaceGraph& graph) {
  if (arguments.method == "toro") {
    return UnimplementedError(
        "--method toro: not for graphs in space (SE3:QUAT); use auto, gauss-newton or "
        "levenberg-marquardt");
  }
  const SparseOptions options = SparseOptionsOf(arguments.method);
  SpaceGraph by_tree = graph;
  Outcome outcome{OptimizeSparse(graph, options), "given"};
  if (arguments.method == "auto") {
    PlaceByTree(BreadthFirstTree(by_tree), by_tree);
    OptimizationSummary from_tree = OptimizeSparse(by_tree, options);
    if (from_tree.chi2_after < outcome.summary.chi2_after) {
      from_tree.chi2_before = outcome.summary.chi2_before;
      outcome = {from_tree, "tree"};
      graph = std::move(by_tree);
    }
  }
  return outcome;
}

struct Times {
  double read_s = 0.0;
  double solve_s = 0.0;
  double write_s = 0.0;
};

std::uint64_t SkippedCount(const G2oGraph& graph) {
  std::uint64_t count = 0;
  for (const auto& [tag, records] : graph.skipped) {
    count += records;
  }
  return count;
}

void PrintJson(const OptimizeArguments& arguments,
               const G2oGraph& graph,
               const Outcome& outcome,
               const Times& times,
               std::ostream& out) {
  const OptimizationSummary& summary = outcome.summary;
  JsonWriter json;
  json.BeginObject().Key("in").Value(arguments.in).Key("out").Value(arguments.out);
  json.Key("method").Value(arguments.method).Key("start").Value(outcome.start);
  json.Key("dimension").Value(std::int64_t{graph.in_space() ? 3 : 2});
  json.Key("poses").Value(
      std::uint64_t{graph.plane.map_from_node.size() + graph.space.map_from_node.size()});
  json.Key("points").Value(std::uint64_t{graph.plane.points_in_map.size()});
  json.Key("constraints")
      .Value(std::uint64_t{graph.plane.constraints.size() + graph.plane.point_constraints.size() +
                           graph.space.constraints.size()});
  json.Key("components")
      .Value(std::uint64_t{graph.in_space() ? FindComponents(graph.space).count
                                            : FindComponents(graph.plane).count});
  json.Key("iterations").Value(std::int64_t{summary.iterations});
  json.Key("converged").Value(summary.converged);
  json.Key("chi2_before").Value(summary.chi2_before);
  json.Key("chi2_after").Value(summary.chi2_after);
  json.Key("seconds").BeginObject().Key("read").Value(times.read_s);
  json.Key("solve").Value(times.solve_s).Key("write").Value(times.write_s).EndObject();
  json.Key("skipped").BeginObject();
  for (const auto& [tag, records] : graph.skipped) {
    json.Key(tag).Value(records);
  }
  json.EndObject().EndObject();
  out << json.text() << '\n';
}

void PrintText(const OptimizeArguments& arguments,
               const G2oGraph& graph,
               const Outcome& outcome,
               const Times& times,
               std::ostream& out) {
  const OptimizationSummary& summary = outcome.summary;
  out << graph.plane.map_from_node.size() + graph.space.map_from_node.size() << " poses, "
      << graph.plane.points_in_map.size() << " points, "
      << graph.plane.constraints.size() + graph.plane.point_constraints.size() +
             graph.space.constraints.size()
      << " constraints";
  if (const std::uint64_t skipped = SkippedCount(graph); skipped > 0) {
    out << ", " << skipped << " other records passed over";
  }
  out << "\nchi2 " << FixedText(summary.chi2_before, 6) << " -> "
      << FixedText(summary.chi2_after, 6) << " in " << summary.iterations
      << (arguments.method == "toro" ? " sweeps" : " iterations") << " from the start '"
      << outcome.start << "'";
  if (arguments.method != "toro") {
    out << (summary.converged ? ", converged" : ", not converged");
  }
  out << "\nread " << FixedText(times.read_s, 3) << " s, solved " << FixedText(times.solve_s, 3)
      << " s, wrote " << arguments.out << '\n';
}

Status RunOptimize(Context& context, const OptimizeArguments& arguments) {
  Times times;
  const auto begin = std::chrono::steady_clock::now();
  LOCI_ASSIGN_OR_RETURN(const std::string text, ReadFile(arguments.in));
  StatusOr<G2oGraph> parsed = ParseG2o(text);
  if (!parsed.ok()) {
    return Status(parsed.status().code(), arguments.in + ": " + parsed.status().message());
  }
  G2oGraph& graph = *parsed;
  if (graph.plane.map_from_node.empty() && graph.space.map_from_node.empty()) {
    return InvalidArgumentError(arguments.in + ": no pose in it, " +
                                std::to_string(SkippedCount(graph)) + " other records");
  }
  times.read_s = SecondsSince(begin);
  const auto solve_begin = std::chrono::steady_clock::now();
  StatusOr<Outcome> outcome = graph.in_space() ? OptimizeSpace(arguments, graph.space)
                                               : OptimizePlane(arguments, graph.plane);
  if (!outcome.ok()) {
    return outcome.status();
  }
  times.solve_s = SecondsSince(solve_begin);
  const auto write_begin = std::chrono::steady_clock::now();
  LOCI_RETURN_IF_ERROR(WriteFile(arguments.out, PrintG2o(graph)));
  times.write_s = SecondsSince(write_begin);
  if (context.json()) {
    PrintJson(arguments, graph, *outcome, times, context.out());
  } else {
    PrintText(arguments, graph, *outcome, times, context.out());
  }
  return {};
}

}  // namespace

std::vector<Command> MakeGraphCommands() {
  auto arguments = std::make_shared<OptimizeArguments>();
  Command command;
  command.name = "graph optimize";
  command.help =
      "Optimise a pose graph and write it as .g2o with every vertex. Reads .g2o in the plane (with "
      "landmarks) and in space, TORO's and iSAM's text, also compressed by gzip or bzip2. chi2 is "
      "the sum of e^T Omega e, as g2o counts it.";
  command.examples =
      "graph optimize intel.g2o --out optimised.g2o\n"
      "graph optimize manhattan.g2o --out swept.g2o --method toro --sweeps 50 --json";
  command.arguments = {
      {.name = "IN", .target = &arguments->in, .help = "The graph", .required = true},
      {.name = "--out",
       .target = &arguments->out,
       .help = "Where the result goes",
       .required = true,
       .value_name = "OUT.g2o"},
      {.name = "--method",
       .target = &arguments->method,
       .help = "auto tries several starts with Gauss-Newton and keeps the best minimum; toro is "
               "gradient descent alone, robust but not exact",
       .choices = {"auto", "toro", "gauss-newton", "levenberg-marquardt"}},
      {.name = "--sweeps", .target = &arguments->sweeps, .help = "Of --method toro (100)"}};
  command.needs_server = false;
  command.run = [arguments](Context& context) { return RunOptimize(context, *arguments); };
  std::vector<Command> commands;
  commands.push_back(std::move(command));
  return commands;
}

}  // namespace loci::cli
