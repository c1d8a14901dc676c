// SPDX-License-Identifier: Apache-2.0
// Counts, times and chi2 as JSON and as text.
#include "clients/cli/offline/graph_report.h"

#include <cstddef>
#include <cstdint>
#include <sstream>
#include <string_view>
#include <utility>

#include "clients/cli/json_output.h"
#include "clients/cli/text_output.h"
#include "core/graph/graph_start.h"

namespace loci::cli {
namespace {

struct Counts {
  std::uint64_t poses = 0;
  std::uint64_t points = 0;
  std::uint64_t constraints = 0;
  std::uint64_t priors = 0;
  std::uint64_t components = 0;
  std::uint64_t zero_informations = 0;
};

template <typename Graph>
Counts CountsOf(const Graph& graph) {
  return {.poses = graph.map_from_node.size(),
          .points = graph.points_in_map.size(),
          .constraints = graph.constraints.size() + graph.point_constraints.size(),
          .priors = graph.pose_priors.size() + graph.position_priors.size(),
          .components = FindComponents(graph).count,
          .zero_informations = CountZeroInformation(graph)};
}

Counts CountsOf(const G2oGraph& graph) {
  return graph.in_space() ? CountsOf(graph.space) : CountsOf(graph.plane);
}

bool IsDescent(const GraphReport& report) {
  return report.method == "toro";
}

void AddSolve(const GraphReport& report, JsonWriter& json) {
  const SolveReport& solve = report.solve;
  json.Key("iterations").Value(std::int64_t{solve.summary.iterations});
  json.Key("converged").Value(solve.summary.converged);
  json.Key("chi2_before").Value(solve.summary.chi2_before);
  json.Key("chi2_start").Value(solve.chi2_start);
  json.Key("chi2_after").Value(solve.summary.chi2_after);
  json.Key("seconds").BeginObject().Key("read").Value(report.read_s);
  json.Key("start").Value(solve.start_s).Key("solve").Value(solve.solve_s);
  json.Key("write").Value(report.write_s).EndObject();
  if (solve.steps.has_value()) {
    json.Key("steps").BeginObject().Key("count").Value(std::uint64_t{solve.steps->count});
    json.Key("mean_ms").Value(solve.steps->mean_ms);
    json.Key("median_ms").Value(solve.steps->median_ms);
    json.Key("p95_ms").Value(solve.steps->p95_ms);
    json.Key("max_ms").Value(solve.steps->max_ms).EndObject();
  }
  json.Key("attempts").BeginArray();
  for (const StartAttempt& attempt : solve.attempts) {
    json.BeginObject().Key("start").Value(GraphStartName(attempt.start));
    json.Key("chi2_start").Value(attempt.cost_before);
    json.Key("chi2_after").Value(attempt.cost_after);
    json.Key("iterations").Value(std::int64_t{attempt.iterations});
    json.Key("converged").Value(attempt.converged).EndObject();
  }
  json.EndArray();
}

// Nodes by their ids in the file.
void AddClosures(const ClosureReport& closures, const G2oGraph& graph, JsonWriter& json) {
  json.Key("closures").BeginObject().Key("accepted").Value(closures.accepted_count);
  json.Key("refused").Value(std::uint64_t{closures.refused.size()});
  json.Key("refused_constraints").BeginArray();
  for (const RefusedClosure& refused : closures.refused) {
    json.BeginObject().Key("from").Value(graph.node_ids[refused.from]);
    json.Key("to").Value(graph.node_ids[refused.to]);
    json.Key("chi2").Value(refused.chi2).EndObject();
  }
  json.EndArray().EndObject();
}

}  // namespace

std::string SkippedText(const G2oGraph& graph) {
  std::uint64_t count = 0;
  std::string tags;
  for (const auto& [tag, records] : graph.skipped) {
    count += records;
    tags += (tags.empty() ? " (" : ", ") + std::to_string(records) + " " + tag;
  }
  return std::to_string(count) + " other records" + (tags.empty() ? "" : tags + ")");
}

std::string JsonOf(const GraphReport& report, const G2oGraph& graph) {
  const Counts counts = CountsOf(graph);
  JsonWriter json;
  json.BeginObject().Key("in").Value(report.in).Key("out").Value(report.out);
  json.Key("method").Value(report.method).Key("robust").Value(report.robust);
  json.Key("start").Value(report.solve.start);
  json.Key("dimension").Value(std::int64_t{graph.in_space() ? 3 : 2});
  json.Key("poses").Value(counts.poses).Key("points").Value(counts.points);
  json.Key("constraints").Value(counts.constraints).Key("priors").Value(counts.priors);
  json.Key("components").Value(counts.components);
  json.Key("zero_informations").Value(counts.zero_informations);
  AddSolve(report, json);
  if (report.solve.closures.has_value()) {
    AddClosures(*report.solve.closures, graph, json);
  }
  json.Key("skipped").BeginObject();
  for (const auto& [tag, records] : graph.skipped) {
    json.Key(tag).Value(records);
  }
  json.EndObject().EndObject();
  return json.text() + "\n";
}

std::string TextOf(const GraphReport& report, const G2oGraph& graph) {
  const Counts counts = CountsOf(graph);
  const SolveReport& solve = report.solve;
  std::ostringstream out;
  out << counts.poses << " poses, " << counts.points << " points, " << counts.constraints
      << " constraints";
  if (counts.priors > 0) {
    out << ", " << counts.priors << " priors";
  }
  out << ", " << counts.components << (counts.components == 1 ? " component" : " components");
  if (counts.zero_informations > 0) {
    out << ", " << counts.zero_informations << " of zero information";
  }
  if (!graph.skipped.empty()) {
    out << "; passed over " << SkippedText(graph);
  }
  out << '\n';
  for (const StartAttempt& attempt : solve.attempts) {
    out << "  from '" << GraphStartName(attempt.start) << "': chi2 "
        << FixedText(attempt.cost_before, 6) << " -> " << FixedText(attempt.cost_after, 6) << " in "
        << attempt.iterations << " iterations" << (attempt.converged ? "" : ", not converged")
        << '\n';
  }
  out << "chi2 " << FixedText(solve.summary.chi2_before, 6) << " -> "
      << FixedText(solve.summary.chi2_after, 6) << " in " << solve.summary.iterations
      << (IsDescent(report) ? " sweeps" : " iterations") << " from the start '" << solve.start
      << "'";
  if (!IsDescent(report)) {
    out << (solve.summary.converged ? ", converged" : ", not converged");
  }
  if (solve.steps.has_value()) {
    out << "\na step took " << FixedText(solve.steps->mean_ms, 3) << " ms in the mean, "
        << FixedText(solve.steps->median_ms, 3) << " in the middle, "
        << FixedText(solve.steps->p95_ms, 3) << " at 95 %, " << FixedText(solve.steps->max_ms, 3)
        << " at most";
  }
  if (solve.closures.has_value()) {
    out << '\n'
        << solve.closures->accepted_count << " closures accepted, "
        << solve.closures->refused.size() << " refused and left out";
    const char* separator = ": ";
    for (const auto& refused : solve.closures->refused) {
      out << std::exchange(separator, ", ") << refused.from << '-' << refused.to;
    }
  }
  out << "\nread " << FixedText(report.read_s, 3) << " s, starts " << FixedText(solve.start_s, 3)
      << " s, solved " << FixedText(solve.solve_s, 3) << " s, wrote " << report.out << '\n';
  return out.str();
}

}  // namespace loci::cli
