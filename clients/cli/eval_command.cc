// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/eval_command.h"

#include <memory>
#include <ostream>
#include <string>

#include "clients/cli/evaluation.h"
#include "clients/cli/grid_file.h"
#include "clients/cli/json_output.h"
#include "clients/cli/text_output.h"

namespace loci::cli {
namespace {

constexpr double kDegree = kPi / 180.0;

struct EvalOptions {
  std::string estimate;
  std::string truth;
  double gap_max_s = 0.5;
};

void Write(JsonWriter& json, const char* key, const ErrorFigures& figures, double unit) {
  json.Key(key).BeginObject();
  json.Key("rms").Value(figures.rms / unit);
  json.Key("mean").Value(figures.mean / unit);
  json.Key("max").Value(figures.max / unit).EndObject();
}

std::string TextOf(const ErrorFigures& figures, double unit) {
  return "rms " + FixedText(figures.rms / unit, 4) + ", mean " + FixedText(figures.mean / unit, 4) +
         ", max " + FixedText(figures.max / unit, 4);
}

void Print(Context& context, const TrajectoryErrors& errors) {
  if (context.json()) {
    JsonWriter json;
    json.BeginObject();
    json.Key("pairs").Value(std::uint64_t{errors.pair_count});
    json.Key("unmatched").Value(std::uint64_t{errors.unmatched_count});
    Write(json, "translation_m", errors.translation_m, 1.0);
    Write(json, "rotation_deg", errors.rotation_rad, kDegree);
    Write(json, "aligned_translation_m", errors.aligned_translation_m, 1.0);
    Write(json, "aligned_rotation_deg", errors.aligned_rotation_rad, kDegree);
    const Pose2& motion = errors.truth_from_estimate;
    json.Key("truth_from_estimate").BeginObject().Key("x").Value(motion.x);
    json.Key("y").Value(motion.y).Key("theta").Value(motion.theta).EndObject().EndObject();
    context.out() << json.text() << '\n';
    return;
  }
  context.out() << errors.pair_count << " poses compared, " << errors.unmatched_count
                << " without a true one\n"
                << "as they are:  translation (m) " << TextOf(errors.translation_m, 1.0)
                << "; rotation (deg) " << TextOf(errors.rotation_rad, kDegree) << '\n'
                << "aligned:      translation (m) " << TextOf(errors.aligned_translation_m, 1.0)
                << "; rotation (deg) " << TextOf(errors.aligned_rotation_rad, kDegree) << '\n';
}

Status RunTrajectory(Context& context, const EvalOptions& options) {
  LOCI_ASSIGN_OR_RETURN(const std::vector<StampedPose2> estimate, ReadTumFile(options.estimate));
  LOCI_ASSIGN_OR_RETURN(const std::vector<StampedPose2> truth, ReadTumFile(options.truth));
  LOCI_ASSIGN_OR_RETURN(
      const TrajectoryErrors errors,
      CompareTrajectories(estimate, truth, static_cast<std::int64_t>(options.gap_max_s * 1e9)));
  Print(context, errors);
  return {};
}

Status RunGrid(Context& context, const EvalOptions& options) {
  LOCI_ASSIGN_OR_RETURN(const OccupancyMap estimate, ReadGridFile(options.estimate));
  LOCI_ASSIGN_OR_RETURN(const OccupancyMap truth, ReadGridFile(options.truth));
  LOCI_ASSIGN_OR_RETURN(const GridAgreement agreement, CompareGrids(estimate, truth));
  if (context.json()) {
    JsonWriter json;
    json.BeginObject().Key("iou").Value(agreement.iou);
    json.Key("iou_everywhere").Value(agreement.iou_everywhere);
    json.Key("precision").Value(agreement.precision).Key("recall").Value(agreement.recall);
    json.Key("occupied_estimate").Value(std::uint64_t{agreement.occupied_estimate});
    json.Key("occupied_truth").Value(std::uint64_t{agreement.occupied_truth}).EndObject();
    context.out() << json.text() << '\n';
  } else {
    context.out() << "IoU of occupied cells, dilated by one: " << FixedText(agreement.iou, 4)
                  << " where observed (" << FixedText(agreement.iou_everywhere, 4)
                  << " everywhere); precision " << FixedText(agreement.precision, 4) << ", recall "
                  << FixedText(agreement.recall, 4) << '\n';
  }
  return {};
}

Command MakeCommand(const std::string& what,
                    const std::string& estimate_name,
                    const std::string& truth_name,
                    Status (*run)(Context&, const EvalOptions&)) {
  auto options = std::make_shared<EvalOptions>();
  Command command;
  command.name = "eval " + what;
  command.needs_server = false;
  command.arguments = {
      {.name = estimate_name,
       .target = &options->estimate,
       .help = "What was estimated",
       .required = true},
      {.name = truth_name, .target = &options->truth, .help = "What is true", .required = true}};
  if (what == "trajectory") {
    command.arguments.push_back(
        {.name = "--gap",
         .target = &options->gap_max_s,
         .help = "True poses farther apart are not interpolated (default 0.5)",
         .value_name = "S"});
  }
  command.run = [options, run](Context& context) { return run(context, *options); };
  return command;
}

}  // namespace

std::vector<Command> MakeEvalCommands() {
  Command trajectory = MakeCommand("trajectory", "EST.tum", "TRUTH.tum", RunTrajectory);
  trajectory.help =
      "Compare two trajectories (TUM) pose by pose. Gives rms, mean and maximum of the errors, as "
      "they are and after the rigid motion that fits best.";
  trajectory.examples = "eval trajectory r1.tum out/r1-1.truth.tum --json";
  Command grid = MakeCommand("grid", "MAP.yaml", "TRUTH.yaml", RunGrid);
  grid.help =
      "Compare two grids of map_server. Gives the intersection over union of the occupied cells, "
      "dilated by one cell.";
  grid.examples = "eval grid office.yaml out/plan.yaml";
  return {std::move(trajectory), std::move(grid)};
}

}  // namespace loci::cli
