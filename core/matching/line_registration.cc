// SPDX-License-Identifier: Apache-2.0
#include "core/matching/line_registration.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "core/grid/occupancy_grid.h"

namespace loci {
namespace {

constexpr std::int32_t kReachCells = 3;
// The weight of a mean falls with its distance d as (1 - d^2 / R^2)^3, which is close to a Gaussian
// of sigma 0.08 m and needs no exponential.
constexpr double kReachSquaredM2 = 6.0 * 0.08 * 0.08;
constexpr double kWeightMin = 0.5;  // below, the neighbourhood is too empty for a line
constexpr int kFirstGateSteps = 3;

struct LocalLine {
  bool found = false;
  Eigen::Vector2d mean;
  Eigen::Vector2d normal;
};

// The means near a point, as weighted moments.
struct Moments {
  double weight = 0.0;
  double x = 0.0;
  double y = 0.0;
  double xx = 0.0;
  double xy = 0.0;
  double yy = 0.0;
};

Moments MomentsAround(const Eigen::Vector2d& point, const Patch& patch) {
  Moments m;
  const CellIndex center = CellOf(point, patch.cell_size_m());
  patch.VisitSquare(center, kReachCells, [&](const PatchPoint& other) {
    const double x = other.x_m - point.x();
    const double y = other.y_m - point.y();
    const double nearness = 1.0 - (x * x + y * y) * (1.0 / kReachSquaredM2);
    if (nearness <= 0.0) {
      return;
    }
    const double weight = other.weight * nearness * nearness * nearness;
    m.weight += weight;
    m.x += weight * x;
    m.y += weight * y;
    m.xx += weight * x * x;
    m.xy += weight * x * y;
    m.yy += weight * y * y;
  });
  return m;
}

LocalLine LineAround(const Eigen::Vector2d& point, const Patch& patch) {
  const Moments m = MomentsAround(point, patch);
  if (m.weight < kWeightMin) {
    return {};
  }
  const double x = m.x / m.weight;
  const double y = m.y / m.weight;
  const double xx = m.xx / m.weight - x * x;
  const double xy = m.xy / m.weight - x * y;
  const double yy = m.yy / m.weight - y * y;
  // Normal: the eigenvector of the smaller eigenvalue, in closed form.
  const double half_difference = 0.5 * (xx - yy);
  const double root = std::sqrt(half_difference * half_difference + xy * xy);
  if (root < 1e-9) {  // a single mean, or a round heap of them: no direction
    return {};
  }
  const Eigen::Vector2d direction = half_difference >= 0.0
                                        ? Eigen::Vector2d(half_difference + root, xy)
                                        : Eigen::Vector2d(xy, root - half_difference);
  const Eigen::Vector2d unit = direction / direction.norm();
  return {true, point + Eigen::Vector2d(x, y), {-unit.y(), unit.x()}};
}

struct NormalEquations {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  std::size_t inlier_count = 0;
  double residual_sum_m = 0.0;
};

NormalEquations Accumulate(std::span<const Eigen::Vector2d> points_in_robot,
                           const Pose2& patch_from_robot,
                           const Patch& patch,
                           double gate_m) {
  NormalEquations sum;
  const Transformer2 transform(patch_from_robot);
  for (const Eigen::Vector2d& point_in_robot : points_in_robot) {
    const Eigen::Vector2d point = transform * point_in_robot;
    const LocalLine line = LineAround(point, patch);
    if (!line.found) {
      continue;
    }
    const double residual = line.normal.dot(point - line.mean);
    if (std::abs(residual) > gate_m) {
      continue;
    }
    // d point / d xi for the right perturbation pose * Exp(xi): R * [I | (-y, x)].
    const Eigen::Vector2d along_x = transform.Rotate(Eigen::Vector2d::UnitX());
    const Eigen::Vector2d along_y = transform.Rotate(Eigen::Vector2d::UnitY());
    const Eigen::Vector2d turned =
        transform.Rotate(Eigen::Vector2d(-point_in_robot.y(), point_in_robot.x()));
    const Eigen::Vector3d jacobian(
        line.normal.dot(along_x), line.normal.dot(along_y), line.normal.dot(turned));
    const double ratio = residual / kLineSigmaM;
    const double weight = 1.0 / (1.0 + ratio * ratio) / (kLineSigmaM * kLineSigmaM);
    sum.information += weight * jacobian * jacobian.transpose();
    sum.gradient += weight * residual * jacobian;
    ++sum.inlier_count;
    sum.residual_sum_m += std::abs(residual);
  }
  return sum;
}

}  // namespace

Registration RegisterToLines(std::span<const Eigen::Vector2d> points_in_robot,
                             const Pose2& start,
                             const Patch& patch,
                             const RegistrationOptions& options) {
  Registration result;
  result.patch_from_robot = start;
  for (int step = 0; step < options.iterations_max; ++step) {
    const double gate_m = step < kFirstGateSteps ? options.first_gate_m : options.second_gate_m;
    const NormalEquations sum = Accumulate(points_in_robot, result.patch_from_robot, patch, gate_m);
    const Eigen::Vector3d prior_error =
        Log(Inverse(options.prior_patch_from_robot) * result.patch_from_robot);
    // A tiny multiple of the identity keeps the system solvable when nothing was found.
    const Eigen::Matrix3d system =
        sum.information + options.prior_information + 1e-6 * Eigen::Matrix3d::Identity();
    const Eigen::Vector3d gradient = sum.gradient + options.prior_information * prior_error;
    const Eigen::Vector3d xi = -system.ldlt().solve(gradient);
    result.patch_from_robot = result.patch_from_robot * Exp(xi);
    result.information = sum.information;
    result.inlier_count = sum.inlier_count;
    result.mean_residual_m =
        sum.inlier_count == 0 ? 0.0 : sum.residual_sum_m / static_cast<double>(sum.inlier_count);
    if (step > kFirstGateSteps && xi.cwiseAbs().maxCoeff() < options.step_min) {
      break;
    }
  }
  return result;
}

}  // namespace loci
