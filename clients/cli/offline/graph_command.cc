// SPDX-License-Identifier: Apache-2.0
// Reads a graph, optimises it, writes it in g2o's present records and says what it cost.
#include "clients/cli/offline/graph_command.h"

#include <array>
#include <chrono>
#include <memory>
#include <string>
#include <utility>

#include "clients/cli/offline/graph_report.h"
#include "clients/cli/offline/graph_solving.h"
#include "clients/cli/text_output.h"
#include "clients/log/line_source.h"
#include "core/graph/g2o_format.h"

namespace loci::cli {
namespace {

constexpr std::size_t kFileBytesMax = std::size_t{1} << 31U;

struct OptimizeArguments {
  std::string in;
  std::string out;
  SolveRequest request;
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

StatusOr<G2oGraph> ReadGraph(const std::string& path) {
  LOCI_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  StatusOr<G2oGraph> graph = ParseG2o(text);
  if (!graph.ok()) {
    return Status(graph.status().code(), path + ": " + graph.status().message());
  }
  if (graph->plane.map_from_node.empty() && graph->space.map_from_node.empty()) {
    return InvalidArgumentError(path + ": no pose in it, " + SkippedText(*graph));
  }
  return graph;
}

Status RunOptimize(Context& context, const OptimizeArguments& arguments) {
  GraphReport report;
  report.in = arguments.in;
  report.out = arguments.out;
  report.method = arguments.request.incremental ? "incremental" : arguments.request.method;
  report.robust = arguments.request.robust;
  const auto begin = std::chrono::steady_clock::now();
  LOCI_ASSIGN_OR_RETURN(G2oGraph graph, ReadGraph(arguments.in));
  report.read_s = SecondsSince(begin);
  if (graph.in_space()) {
    LOCI_ASSIGN_OR_RETURN(report.solve, Solve(arguments.request, graph.space));
  } else {
    LOCI_ASSIGN_OR_RETURN(report.solve, Solve(arguments.request, graph.plane));
  }
  const auto write_begin = std::chrono::steady_clock::now();
  LOCI_ASSIGN_OR_RETURN(const std::string printed, PrintG2o(graph));
  LOCI_RETURN_IF_ERROR(WriteFile(arguments.out, printed));
  report.write_s = SecondsSince(write_begin);
  context.out() << (context.json() ? JsonOf(report, graph) : TextOf(report, graph));
  return {};
}

std::vector<Argument> ArgumentsInto(OptimizeArguments& arguments) {
  return {
      {.name = "IN",
       .target = &arguments.in,
       .help = "The graph: .g2o, or TORO's or iSAM's text; also as .gz or .bz2",
       .required = true},
      {.name = "--out",
       .target = &arguments.out,
       .help = "Where the result goes",
       .required = true,
       .value_name = "OUT.g2o"},
      {.name = "--method",
       .target = &arguments.request.method,
       .help = "auto: Gauss-Newton from several starts, until two of them agree on the lowest "
               "minimum. gauss-newton, levenberg-marquardt: from one start. toro: gradient descent "
               "on a tree alone, robust but not exact. ceres: only where it is built in",
       .choices = SolveMethods()},
      {.name = "--start",
       .target = &arguments.request.start,
       .help =
           "Begin there and nowhere else. file: the poses of the file. odometry, tree, "
           "uncertainty-tree: composed from pose to pose, along the breadth-first tree, along "
           "the paths of minimum uncertainty. chordal: rotations, then positions, by linear "
           "problems. swept: the tree's after ten sweeps of toro. prefixes: as if the graph were "
           "just being recorded; not in space. auto: what suits the method: several for auto, the "
           "one with the lowest chi2 for gauss-newton, levenberg-marquardt and ceres, the better "
           "of file and tree for toro, the file with --robust",
       .choices = SolveStarts()},
      {.name = "--incremental",
       .target = &arguments.request.incremental,
       .help =
           "Add pose by pose in the order of the file, near the optimum after each, say what a "
           "step costs, and finish as a whole. Not with another method or start, nor for priors, "
           "fixed points and graphs in space"},
      {.name = "--robust",
       .target = &arguments.request.robust,
       .help = "Closures, the constraints between nodes that do not follow each other in the file, "
               "may be wrong: those that are refused are left out of the result. consistent: by "
               "which of them agree, without any start; for many closures of which many are "
               "wrong. huber, cauchy, geman-mcclure (graduated), dcs (dynamic covariance "
               "scaling): by a kernel; for a start near the map, or few that are wrong. Not for "
               "graphs in space",
       .choices = SolveRobustMethods()},
      {.name = "--sweeps",
       .target = &arguments.request.sweeps,
       .help = "Of --method toro alone (100)"}};
}

}  // namespace

std::vector<Command> MakeGraphCommands() {
  auto arguments = std::make_shared<OptimizeArguments>();
  Command command;
  command.name = "graph optimize";
  command.help =
      "Optimise a pose graph and write it as .g2o with every vertex. Reads graphs in the plane "
      "(SE2, points, priors, FIX; old VERTEX2 and EDGE2) and in space (SE3:QUAT, points, priors). "
      "Records of other tags are passed over and counted. chi2 is the sum of e^T Omega e, as g2o "
      "counts it.";
  command.examples =
      "graph optimize intel.g2o --out optimised.g2o\n"
      "graph optimize manhattan.g2o --out swept.g2o --method toro --sweeps 50 --json\n"
      "graph optimize sphere.g2o --out sphere_opt.g2o --method gauss-newton --start chordal\n"
      "graph optimize manhattan.g2o --out grown.g2o --incremental\n"
      "graph optimize matched.g2o --out true.g2o --robust consistent --json";
  command.arguments = ArgumentsInto(*arguments);
  command.needs_server = false;
  command.run = [arguments](Context& context) { return RunOptimize(context, *arguments); };
  std::vector<Command> commands;
  commands.push_back(std::move(command));
  return commands;
}

}  // namespace loci::cli
