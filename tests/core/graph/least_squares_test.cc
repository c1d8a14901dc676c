// SPDX-License-Identifier: Apache-2.0
// The minimiser's steps, on problems of one block.
#include "core/graph/least_squares.h"

#include <cmath>
#include <functional>
#include <utility>

#include <gtest/gtest.h>

namespace loci {
namespace {

// Two residuals of two numbers.
class SmallProblem final : public LeastSquaresProblem {
 public:
  using Residuals = std::function<Eigen::Vector2d(const Eigen::Vector2d&)>;
  using Jacobian = std::function<Eigen::Matrix2d(const Eigen::Vector2d&)>;

  SmallProblem(Residuals residuals, Jacobian jacobian, const Eigen::Vector2d& start)
      : residuals_(std::move(residuals)), jacobian_(std::move(jacobian)), state_(start) {}

  std::vector<int> BlockSizes() const override { return {2}; }
  std::vector<BlockPair> Pairs() const override { return {}; }
  double Cost() const override { return residuals_(state_).squaredNorm(); }
  void Linearise(NormalEquations& equations) const override {
    const Eigen::Matrix2d jacobian = jacobian_(state_);
    equations.AddDiagonal<2>(0, jacobian.transpose() * jacobian);
    equations.AddGradient<2>(0, jacobian.transpose() * residuals_(state_));
  }
  void Move(const Eigen::VectorXd& step, const NormalEquations& /*equations*/) override {
    state_ += step.head<2>();
  }
  void Mark() override { marked_ = state_; }
  void MoveBack() override { state_ = marked_; }

  const Eigen::Vector2d& state() const { return state_; }

 private:
  Residuals residuals_;
  Jacobian jacobian_;
  Eigen::Vector2d state_;
  Eigen::Vector2d marked_ = Eigen::Vector2d::Zero();
};

// Rosenbrock's valley: the undamped step leaves its floor, and the second one ends at its lowest
// point, where damping would creep along the floor.
TEST(LeastSquaresTest, CrossesABentValley) {
  SmallProblem problem(
      [](const Eigen::Vector2d& x) {
        return Eigen::Vector2d(1.0 - x.x(), 10.0 * (x.y() - x.x() * x.x()));
      },
      [](const Eigen::Vector2d& x) {
        Eigen::Matrix2d jacobian;
        jacobian << -1.0, 0.0, -20.0 * x.x(), 10.0;
        return jacobian;
      },
      {-1.2, 1.0});
  const LeastSquaresSummary summary = Minimise(problem, LeastSquaresOptions{});
  EXPECT_TRUE(summary.converged);
  EXPECT_LE(summary.iterations, 4);
  EXPECT_LT((problem.state() - Eigen::Vector2d(1.0, 1.0)).norm(), 1e-9);
}

// A slope that ends at 5; the undamped step goes beyond, to where it is higher and nothing moves.
TEST(LeastSquaresTest, IsNotDoneWhereATrialRests) {
  const auto is_on_slope = [](const Eigen::Vector2d& x) { return x.x() < 5.0; };
  SmallProblem problem(
      [=](const Eigen::Vector2d& x) {
        return is_on_slope(x) ? Eigen::Vector2d(1.0 - 0.1 * x.x(), 0.0) : Eigen::Vector2d(0.0, 2.0);
      },
      [=](const Eigen::Vector2d& x) {
        const Eigen::Vector2d diagonal =
            is_on_slope(x) ? Eigen::Vector2d(-0.1, 1.0) : Eigen::Vector2d(1.0, 1e12);
        return Eigen::Matrix2d(diagonal.asDiagonal());
      },
      {0.0, 0.0});
  EXPECT_LT(Minimise(problem, LeastSquaresOptions{}).cost_after, 0.5);
  EXPECT_LT(problem.state().x(), 5.0);
}

// Where the second step is as bad as the first, both are taken back, and damping does it.
TEST(LeastSquaresTest, GoesBackWhereUndampedStepsDiverge) {
  const auto problem_from = [](double x) {
    return SmallProblem(
        [](const Eigen::Vector2d& v) {
          return Eigen::Vector2d(std::atan(v.x()), std::atan(v.y()));
        },
        [](const Eigen::Vector2d& v) {
          return Eigen::Matrix2d(
              Eigen::Vector2d(1.0 / (1.0 + v.x() * v.x()), 1.0 / (1.0 + v.y() * v.y()))
                  .asDiagonal());
        },
        {x, -x});
  };
  SmallProblem problem = problem_from(3.0);
  const double before = problem.Cost();
  const LeastSquaresSummary summary = Minimise(problem, LeastSquaresOptions{});
  EXPECT_TRUE(summary.converged);
  EXPECT_LT(problem.state().norm(), 1e-4);
  // However early it ends, the state is the best so far.
  for (int iterations_max = 0; iterations_max < 12; ++iterations_max) {
    SmallProblem cut_short = problem_from(3.0);
    const LeastSquaresSummary cut =
        Minimise(cut_short, {.damped_from_start = false, .iterations_max = iterations_max});
    EXPECT_EQ(cut.cost_before, before);
    EXPECT_LE(cut.cost_after, before);
    EXPECT_EQ(cut.cost_after, cut_short.Cost());
  }
}

}  // namespace
}  // namespace loci
