// SPDX-License-Identifier: Apache-2.0
// The elimination tree against a dense factorisation, while terms come, change and go.
#include "core/graph/elimination_tree.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "core/base/random.h"
#include "core/graph/dense_front.h"

namespace loci {
namespace {

// A tree and the same problem as a dense matrix.
class Problem {
 public:
  std::uint32_t AddVariable(int size) {
    const std::uint32_t variable = tree_.AddVariable(size);
    if (variable == sizes_.size()) {
      offsets_.push_back(size_);
      sizes_.push_back(size);
      size_ += size;
    } else {
      EXPECT_EQ(gone_.erase(variable), 1U) << "numbers of variables that are gone only";
      EXPECT_EQ(sizes_[variable], size);
    }
    return variable;
  }
  // With all its terms.
  void RemoveVariable(std::uint32_t variable) {
    for (auto term = terms_.begin(); term != terms_.end();) {
      const std::vector<std::uint32_t>& variables = term->second.variables;
      if (std::find(variables.begin(), variables.end(), variable) != variables.end()) {
        tree_.RemoveTerm(term->first);
        term = terms_.erase(term);
      } else {
        ++term;
      }
    }
    tree_.RemoveVariable(variable);
    gone_.insert(variable);
  }
  bool IsThere(std::uint32_t variable) const {
    return variable < sizes_.size() && gone_.count(variable) == 0;
  }

  // A random positive semidefinite term; of full rank if it is over one variable.
  std::uint32_t AddTerm(const std::vector<std::uint32_t>& variables, RandomSequence& random) {
    const std::uint32_t term = tree_.AddTerm(variables);
    terms_[term].variables = variables;
    SetTerm(term, random);
    return term;
  }
  void SetTerm(std::uint32_t index, RandomSequence& random) {
    Term& term = terms_[index];
    Eigen::Index size = 0;
    for (const std::uint32_t variable : term.variables) {
      size += sizes_[variable];
    }
    const Eigen::MatrixXd root = Eigen::MatrixXd::NullaryExpr(
        std::min<Eigen::Index>(size, 3), size, [&] { return random.NextUniform(-1.0, 1.0); });
    term.h = root.transpose() * root;
    term.b = Eigen::VectorXd::NullaryExpr(size, [&] { return random.NextUniform(-1.0, 1.0); });
    double* values = tree_.SetTerm(index);
    for (Eigen::Index column = 0; column < size; ++column) {
      for (Eigen::Index row = column; row < size; ++row) {
        values[column * (size + 1) + row] = term.h(row, column);
      }
      values[column * (size + 1) + size] = term.b(column);
    }
  }
  void RemoveTerm(std::uint32_t term) {
    tree_.RemoveTerm(term);
    terms_.erase(term);
  }

  // Ties every variable to its place.
  void Anchor(std::uint32_t variable) {
    const std::vector<std::uint32_t> variables{variable};
    const std::uint32_t index = tree_.AddTerm(variables);
    const int size = sizes_[variable];
    terms_[index] = {variables, Eigen::MatrixXd::Identity(size, size), Eigen::VectorXd::Zero(size)};
    double* values = tree_.SetTerm(index);
    for (int i = 0; i < size; ++i) {
      values[i * (size + 1) + i] = 1.0;
    }
  }

  EliminationTree& tree() { return tree_; }

  Eigen::MatrixXd DenseMatrix(Eigen::VectorXd& b) const {
    Eigen::MatrixXd h = Eigen::MatrixXd::Zero(size_, size_);
    b = Eigen::VectorXd::Zero(size_);
    for (const std::uint32_t variable : gone_) {  // has a place, and no part
      h.diagonal().segment(offsets_[variable], sizes_[variable]).setOnes();
    }
    for (const auto& [index, term] : terms_) {
      Eigen::Index row = 0;
      for (const std::uint32_t r : term.variables) {
        Eigen::Index column = 0;
        for (const std::uint32_t c : term.variables) {
          h.block(offsets_[r], offsets_[c], sizes_[r], sizes_[c]) +=
              term.h.block(row, column, sizes_[r], sizes_[c]);
          column += sizes_[c];
        }
        b.segment(offsets_[r], sizes_[r]) += term.b.segment(row, sizes_[r]);
        row += sizes_[r];
      }
    }
    return h;
  }

  void ExpectDenseSolution() {
    std::vector<std::uint32_t> solved;
    tree_.Solve(0.0, solved);
    Eigen::VectorXd b;
    const Eigen::MatrixXd h = DenseMatrix(b);
    const Eigen::VectorXd x = h.llt().solve(b);
    for (std::uint32_t variable = 0; variable < sizes_.size(); ++variable) {
      for (int i = 0; i < sizes_[variable] && IsThere(variable); ++i) {
        EXPECT_NEAR(tree_.Value(variable)[i], x(offsets_[variable] + i), 1e-9 * (1.0 + x.norm()))
            << "variable " << variable;
      }
    }
  }

  void ExpectDenseInverse(RandomSequence& random) const {
    Eigen::VectorXd b;
    const Eigen::MatrixXd inverse = DenseMatrix(b).inverse();
    for (int trial = 0; trial < 10; ++trial) {
      const auto row = static_cast<std::uint32_t>(random.NextBits() % sizes_.size());
      const auto column = static_cast<std::uint32_t>(random.NextBits() % sizes_.size());
      if (!IsThere(row) || !IsThere(column)) {
        continue;
      }
      const Eigen::MatrixXd block = tree_.InverseBlock(row, column);
      const Eigen::MatrixXd expected =
          inverse.block(offsets_[row], offsets_[column], sizes_[row], sizes_[column]);
      EXPECT_LT((block - expected).norm(), 1e-9 * inverse.norm());
      if (row != column) {
        ExpectDenseForm(row, column, inverse, random);
      }
    }
  }

  void ExpectDenseForm(std::uint32_t first,
                       std::uint32_t second,
                       const Eigen::MatrixXd& inverse,
                       RandomSequence& random) const {
    Eigen::MatrixXd a(sizes_[first] + sizes_[second], 2);
    Eigen::MatrixXd wide = Eigen::MatrixXd::Zero(inverse.rows(), 2);
    for (Eigen::Index i = 0; i < a.size(); ++i) {
      a(i) = random.NextUniform(-1.0, 1.0);
    }
    wide.middleRows(offsets_[first], sizes_[first]) = a.topRows(sizes_[first]);
    wide.middleRows(offsets_[second], sizes_[second]) = a.bottomRows(sizes_[second]);
    const std::array<std::uint32_t, 2> variables{first, second};
    const Eigen::MatrixXd expected = wide.transpose() * inverse * wide;
    EXPECT_LT((tree_.InverseForm(variables, a) - expected).norm(), 1e-9 * inverse.norm());
  }

  std::vector<double> Values() const {
    std::vector<double> values;
    for (std::uint32_t variable = 0; variable < sizes_.size(); ++variable) {
      values.insert(values.end(), tree_.Value(variable), tree_.Value(variable) + sizes_[variable]);
    }
    return values;
  }

  std::uint32_t AnyTerm(RandomSequence& random) const {
    auto found = terms_.begin();
    std::advance(found, static_cast<std::ptrdiff_t>(random.NextBits() % terms_.size()));
    return found->first;
  }
  // Of two variables or more: what the anchors are not.
  bool IsJoint(std::uint32_t term) const { return terms_.at(term).variables.size() > 1; }

 private:
  struct Term {
    std::vector<std::uint32_t> variables;
    Eigen::MatrixXd h;
    Eigen::VectorXd b;
  };

  EliminationTree tree_;
  std::vector<int> sizes_;
  std::set<std::uint32_t> gone_;
  std::vector<Eigen::Index> offsets_;
  Eigen::Index size_ = 0;
  std::map<std::uint32_t, Term> terms_;
};

// Variables of 1 to 6 numbers in a chain, with terms across it of two to four variables.
void Grow(Problem& problem, std::uint32_t count, RandomSequence& random) {
  const auto begin = static_cast<std::uint32_t>(problem.tree().variable_count());
  for (std::uint32_t variable = begin; variable < begin + count; ++variable) {
    problem.AddVariable(1 + static_cast<int>(random.NextBits() % 6));
    problem.Anchor(variable);
    if (variable > 0) {
      problem.AddTerm({variable, variable - 1}, random);
    }
    if (variable > 3 && random.NextBits() % 3 == 0) {
      std::vector<std::uint32_t> variables{variable};
      const std::size_t size = 2 + random.NextBits() % 3;
      while (variables.size() < size) {
        const auto other = static_cast<std::uint32_t>(random.NextBits() % variable);
        if (std::find(variables.begin(), variables.end(), other) == variables.end()) {
          variables.push_back(other);
        }
      }
      problem.AddTerm(variables, random);
    }
  }
}

TEST(EliminationTreeTest, EqualsTheDenseSolutionWhileTermsComeChangeAndGo) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    RandomSequence random(seed);
    Problem problem;
    for (int round = 0; round < 12; ++round) {
      Grow(problem, 1 + static_cast<std::uint32_t>(random.NextBits() % 12), random);
      for (int change = 0; change < 3; ++change) {
        const std::uint32_t term = problem.AnyTerm(random);
        if (problem.IsJoint(term)) {
          random.NextBits() % 2 == 0 ? problem.RemoveTerm(term) : problem.SetTerm(term, random);
        }
      }
      const std::vector<std::uint32_t> last{
          static_cast<std::uint32_t>(problem.tree().variable_count() - 1), 0};
      if (round % 3 == 2) {
        ASSERT_TRUE(problem.tree().EliminateAll());
      } else {
        ASSERT_TRUE(problem.tree().Eliminate(random.NextBits() % 2 == 0 || last.front() == 0
                                                 ? std::span<const std::uint32_t>()
                                                 : std::span(last)));
      }
      problem.ExpectDenseSolution();
    }
    problem.ExpectDenseInverse(random);
  }
}

TEST(EliminationTreeTest, EqualsTheDenseSolutionWhileVariablesComeAndGo) {
  for (std::uint64_t seed = 31; seed <= 50; ++seed) {
    SCOPED_TRACE(seed);
    RandomSequence random(seed);
    Problem problem;
    std::vector<std::uint32_t> there;
    for (int round = 0; round < 60; ++round) {
      for (std::uint64_t added = 1 + random.NextBits() % 7; added > 0; --added) {
        const std::uint32_t variable =
            problem.AddVariable(1 + static_cast<int>(random.NextBits() % 3));
        problem.Anchor(variable);
        for (std::uint64_t others = random.NextBits() % 3; others > 0 && !there.empty(); --others) {
          problem.AddTerm({variable, there[random.NextBits() % there.size()]}, random);
        }
        there.push_back(variable);
      }
      // All of them, now and then.
      std::uint64_t going = round % 20 == 19 ? there.size() : random.NextBits() % 6;
      for (; going > 0 && !there.empty(); --going) {
        const auto which =
            there.begin() + static_cast<std::ptrdiff_t>(random.NextBits() % there.size());
        problem.RemoveVariable(*which);
        there.erase(which);
      }
      const std::vector<std::uint32_t> last(there.begin(), there.begin() + (there.empty() ? 0 : 1));
      ASSERT_TRUE(problem.tree().Eliminate(last));
      problem.ExpectDenseSolution();
      problem.ExpectDenseInverse(random);
    }
    EXPECT_LE(problem.tree().variable_count(), 120U) << "about 240 have been";
  }
}

TEST(EliminationTreeTest, LargeFrontsEqualTheDenseSolutionToo) {
  RandomSequence random(5);
  Problem problem;
  for (std::uint32_t variable = 0; variable < 40; ++variable) {
    problem.AddVariable(3);
    problem.Anchor(variable);
    for (std::uint32_t other = 0; other < variable; ++other) {
      problem.AddTerm({other, variable}, random);  // all with all: one front of 120 columns
    }
  }
  ASSERT_TRUE(problem.tree().Eliminate({}));
  problem.ExpectDenseSolution();
  problem.ExpectDenseInverse(random);
}

TEST(EliminationTreeTest, WithoutComplementsTheSolutionIsTheSame) {
  RandomSequence random(6);
  Problem problem;
  for (int round = 0; round < 10; ++round) {
    Grow(problem, 20, random);
    ASSERT_TRUE(problem.tree().Eliminate({}));  // in pieces of an order
    ASSERT_TRUE(problem.tree().EliminateAll());
    problem.ExpectDenseSolution();
    problem.ExpectDenseInverse(random);
    problem.SetTerm(problem.AnyTerm(random), random);
    ASSERT_TRUE(problem.tree().EliminateAll());  // in the same order
    problem.ExpectDenseSolution();
  }
}

TEST(EliminationTreeTest, AFrontHasTheSameBitsOnEveryProcessor) {
  RandomSequence random(17);
  for (std::ptrdiff_t size = 1; size <= 70; ++size) {
    const std::ptrdiff_t stride = StrideOf(size);
    std::vector<double> front(static_cast<std::size_t>(stride * size), 0.0);
    for (std::ptrdiff_t column = 0; column < size; ++column) {
      for (std::ptrdiff_t row = column; row <= size; ++row) {
        front[static_cast<std::size_t>(column * stride + row)] = random.NextUniform(-1.0, 1.0);
      }
      front[static_cast<std::size_t>(column * stride + column)] += static_cast<double>(size);
    }
    std::vector<double> plain = front;
    const std::ptrdiff_t columns = (size + 1) / 2;
    ASSERT_TRUE(EliminateColumns(front.data(), size, columns));
    ASSERT_TRUE(EliminateColumnsPlainly(plain.data(), size, columns));
    for (std::ptrdiff_t column = 0; column < size; ++column) {
      for (std::ptrdiff_t row = column; row <= size; ++row) {
        const auto at = static_cast<std::size_t>(column * stride + row);
        ASSERT_EQ(front[at], plain[at]) << "size " << size << ", " << row << ", " << column;
      }
    }
    std::vector<double> x(static_cast<std::size_t>(size));
    std::generate(x.begin(), x.end(), [&] { return random.NextUniform(-1.0, 1.0); });
    std::vector<double> plain_x = x;
    SolveColumns(front.data(), size, columns, x.data());
    SolveColumnsPlainly(plain.data(), size, columns, plain_x.data());
    ASSERT_EQ(x, plain_x) << "size " << size;
  }
}

TEST(EliminationTreeTest, AnEndOfAChainConcernsOnlyTheEnd) {
  RandomSequence random(3);
  Problem problem;
  std::size_t eliminated = 0;
  for (std::uint32_t variable = 0; variable < 1000; ++variable) {
    problem.AddVariable(3);
    problem.Anchor(variable);
    if (variable > 0) {
      problem.AddTerm({variable - 1, variable}, random);
    }
    const std::vector<std::uint32_t> last{variable};
    ASSERT_TRUE(problem.tree().Eliminate(last));
    eliminated += problem.tree().eliminated_count();
  }
  EXPECT_LE(eliminated, 10'000U) << "with a new order of the whole each time it has doubled";
  problem.ExpectDenseSolution();
}

// The square's middle line divides it in two, and is the root of an order of little fill.
TEST(EliminationTreeTest, WhereThingsChangedTheNextChangesAreCheap) {
  constexpr std::uint32_t kSide = 30;
  RandomSequence random(17);
  Problem problem;
  for (std::uint32_t at = 0; at < kSide * kSide; ++at) {
    problem.AddVariable(1);
    problem.Anchor(at);
    if (at % kSide > 0) {
      problem.AddTerm({at - 1, at}, random);
    }
    if (at >= kSide) {
      problem.AddTerm({at - kSide, at}, random);
    }
  }
  ASSERT_TRUE(problem.tree().Eliminate({}));
  for (const std::uint32_t place : {3 * kSide + 3, 15 * kSide + 15, 4 * kSide + 26}) {
    for (int visit = 0; visit < 2; ++visit) {
      const std::vector<std::uint32_t> ends{place, place + 1};
      problem.AddTerm(ends, random);
      ASSERT_TRUE(problem.tree().Eliminate(ends));
      if (visit > 0) {
        EXPECT_LE(problem.tree().eliminated_count(), 12U) << "about " << place;
      }
      problem.ExpectDenseSolution();
    }
  }
}

TEST(EliminationTreeTest, WhatIsNotDeterminedIsToldAndMendedByATermThatSaysIt) {
  RandomSequence random(7);
  Problem problem;
  Grow(problem, 10, random);
  const std::uint32_t loose = problem.AddVariable(2);
  EXPECT_FALSE(problem.tree().Eliminate({}));
  EXPECT_FALSE(problem.tree().Eliminate({}));
  problem.Anchor(loose);
  ASSERT_TRUE(problem.tree().Eliminate({}));
  problem.ExpectDenseSolution();
}

// The term w (R_b x_b - R_a x_a)^T (R_b x_b - R_a x_a) / 2 of two variables of three numbers, R
// rotations: it says nothing of both together.
void SetDifference(std::uint32_t term, double w, RandomSequence& random, EliminationTree& tree) {
  Eigen::Matrix<double, 3, 6> jacobian = Eigen::Matrix<double, 3, 6>::Zero();
  for (const int begin : {0, 3}) {
    const Eigen::Vector4d axis =
        Eigen::Vector4d::NullaryExpr([&](Eigen::Index) { return random.NextUniform(-1.0, 1.0); });
    jacobian.middleCols<3>(begin) = Eigen::Quaterniond(axis.normalized()).toRotationMatrix();
  }
  jacobian.leftCols<3>() *= -1.0;
  const Eigen::Matrix<double, 6, 6> h = w * jacobian.transpose() * jacobian;
  double* values = tree.SetTerm(term);
  for (int column = 0; column < 6; ++column) {
    for (int row = column; row < 6; ++row) {
      values[column * 7 + row] = h(row, column);
    }
    values[column * 7 + 6] = 1.0;
  }
}

// A chain of `count` variables tied by `stiffness`, and its first by `tie` to where it is.
bool IsChainDetermined(std::uint64_t seed, int count, double stiffness, double tie) {
  RandomSequence random(seed);
  EliminationTree tree;
  std::vector<std::uint32_t> chain;
  for (int i = 0; i < count; ++i) {
    chain.push_back(tree.AddVariable(3));
  }
  for (std::size_t i = 1; i < chain.size(); ++i) {
    const std::vector<std::uint32_t> variables{chain[i - 1], chain[i]};
    SetDifference(tree.AddTerm(variables), stiffness, random, tree);
  }
  const std::vector<std::uint32_t> first{chain.front()};
  double* values = tree.SetTerm(tree.AddTerm(first));
  for (int k = 0; k < 3; ++k) {
    values[k * 5] = tie;
  }
  return tree.Eliminate({});
}

// What the elimination of a chain without a tie leaves is rounding: positive as often as not.
TEST(EliminationTreeTest, RoundingOfLargeNumbersDeterminesNothing) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    for (const double stiffness : {1.0, 1e4, 1e12}) {
      EXPECT_FALSE(IsChainDetermined(seed, 12, stiffness, 0.0)) << seed << ", " << stiffness;
      EXPECT_TRUE(IsChainDetermined(seed, 12, stiffness, stiffness)) << seed << ", " << stiffness;
    }
  }
}

TEST(EliminationTreeTest, ATieThatIsATrillionTimesWeakerDetermines) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    EXPECT_TRUE(IsChainDetermined(seed, 12, 1e12, 1.0)) << seed;
    EXPECT_TRUE(IsChainDetermined(seed, 12, 1.0, 1e-12)) << seed;
  }
}

TEST(EliminationTreeTest, TheSameCallsGiveTheSameBits) {
  std::vector<std::vector<double>> runs;
  for (int run = 0; run < 2; ++run) {
    RandomSequence random(11);
    Problem problem;
    for (int round = 0; round < 10; ++round) {
      Grow(problem, 10, random);
      ASSERT_TRUE(problem.tree().Eliminate({}));
      std::vector<std::uint32_t> solved;
      problem.tree().Solve(1e-3, solved);
    }
    runs.push_back(problem.Values());
  }
  EXPECT_EQ(runs[0], runs[1]);
}

TEST(EliminationTreeTest, ResetValuesCountFromZeroAgain) {
  RandomSequence random(13);
  Problem problem;
  Grow(problem, 5, random);
  ASSERT_TRUE(problem.tree().Eliminate({}));
  std::vector<std::uint32_t> solved;
  problem.tree().Solve(0.0, solved);
  EXPECT_EQ(solved.size(), 5U);
  problem.tree().ResetValue(2);
  EXPECT_EQ(problem.tree().Value(2)[0], 0.0);
}

}  // namespace
}  // namespace loci
