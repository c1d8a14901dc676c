// SPDX-License-Identifier: Apache-2.0
// A sparse least squares problem that grows and changes, and is solved again at the cost of what
// changed.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/graph/elimination_order.h"
#include "core/graph/number_buffer.h"

namespace loci {

// Minimises the sum of quadratic terms 1/2 x^T H x - b^T x over small groups of variables, by a
// multifrontal Cholesky factorisation whose fronts are kept. What Kaess et al. (iSAM2, IJRR 2012)
// do with a Bayes tree: a term concerns the front that eliminates the first of its variables, and
// the fronts above that one up to the root. Only these are eliminated again, in a new order;
// the Schur complements of all below them stand. No search for a global order, and no batch step.
//
// The new order moves the root to where things change. The variables that divide the whole in two
// parts are many, and last in an order of little fill; there they would be eliminated with every
// change. Ordered by their distance they are behind the root, and small rings before it.
//
// The same calls give the same bits. Not thread-safe.
class EliminationTree {
 public:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;

  // Room for so many variables, each with a term of its own, and for terms of two of them.
  void Reserve(std::size_t variables, std::size_t terms);
  // A tree over as many variables, of `size` numbers each, and the same terms, all zero, which is
  // ordered as this one, and spares the work. This one must be ordered.
  EliminationTree Resized(int size) const;

  // A variable of `size` numbers, at 0. Named by their count, or as one that is gone.
  std::uint32_t AddVariable(int size);
  // The variable, of which no term is left, goes with the next Eliminate; from then on its number
  // may be given to another one.
  void RemoveVariable(std::uint32_t variable);
  // A term over these variables, no two of them equal; all zero until it is set.
  std::uint32_t AddTerm(std::span<const std::uint32_t> variables);
  // The term's numbers, to be written: column by column the lower triangle of H (size n, all the
  // variables of the term in turn) and b in row n; n + 1 numbers a column. Valid until the next
  // AddTerm.
  double* SetTerm(std::uint32_t term);
  // The same, for those who call EliminateAll afterwards.
  double* TermValues(std::uint32_t term) { return &term_values_[terms_[term].values]; }
  const double* TermValues(std::uint32_t term) const { return &term_values_[terms_[term].values]; }
  // The term is gone; its number may be given to another. It must be there.
  void RemoveTerm(std::uint32_t term);

  // Finds the order of elimination of all variables, which Eliminate would do otherwise.
  void Order();
  // Brings the factorisation up to date. What is concerned is eliminated the later the fewer terms
  // are between it and the variables of `last`, these at the very end: what is likely to change
  // next is cheap then. False, and the factorisation stays open, if the terms do not determine
  // every variable: if so little is left of one of its numbers on the diagonal, when its turn
  // comes, that it may be rounding.
  bool Eliminate(std::span<const std::uint32_t> last);
  // The same for those who set all terms anew each time: in less room, and faster for that, since
  // no Schur complement is kept. The next Eliminate, if there is one, concerns all fronts.
  bool EliminateAll();

  // Solves for what changed: a front is solved again if it was eliminated again, or if a variable
  // above it has moved by more than `change_min` since. Appends all variables that were solved.
  void Solve(double change_min, std::vector<std::uint32_t>& solved);

  // Value of a variable, as of the last Solve.
  const double* Value(std::uint32_t variable) const { return &value_[variables_[variable].offset]; }
  // A block of the inverse of H, rows of one variable and columns of another, after an Eliminate
  // that succeeded. Costs the fronts above the two.
  Eigen::MatrixXd InverseBlock(std::uint32_t row, std::uint32_t column) const;
  // a^T H^-1 a for a matrix that has rows for these variables only, in their order; no two of them
  // equal. Positive semidefinite, whatever is rounded; costs the fronts above the variables.
  Eigen::MatrixXd InverseForm(std::span<const std::uint32_t> variables,
                              const Eigen::MatrixXd& a) const;
  // The caller has set all terms of this variable anew, about its value: it is 0 now.
  void ResetValue(std::uint32_t variable);

  // Numbers that have been given, those that may be given again included: what memory grows with.
  std::size_t variable_count() const { return variables_.size(); }
  std::size_t term_count() const { return terms_.size(); }
  std::size_t front_count() const { return fronts_.size(); }
  // Of the last Eliminate.
  std::size_t eliminated_count() const { return eliminated_count_; }

 private:
  struct Variable {
    int size = 0;
    std::uint32_t offset = 0;         // into value_
    std::uint32_t front = kNone;      // that eliminates it
    std::uint32_t row = 0;            // its first row in the front at hand
    std::uint32_t first_use = kNone;  // by a term, the latest first
    bool touched = false;
    bool gone = false;
  };
  // That a term is over a variable; the uses of a variable are a list.
  struct Use {
    std::uint32_t term = 0;
    std::uint32_t next = kNone;
  };
  struct Term {
    std::uint32_t begin = 0;  // into term_variables_ and uses_
    std::uint32_t count = 0;
    std::uint32_t values = 0;     // into term_values_
    std::uint32_t size = 0;       // scalars
    std::uint32_t first = kNone;  // the variable that is eliminated first
  };
  struct Front {
    std::vector<std::uint32_t> variables;  // those that it eliminates, then the rest
    std::uint32_t eliminated = 0;          // variables that it eliminates
    std::uint32_t columns = 0;             // scalars of those
    std::uint32_t size = 0;                // scalars of all
    std::uint32_t parent = kNone;
    std::vector<std::uint32_t> children;
    NumberBuffer values;         // the columns of L (dense_front.h), then, if kept, the complement
    std::size_t complement = 0;  // where the Schur complement begins, there or on the stack
    std::uint64_t sequence = 0;  // children have a lower one than their parents
    bool affected = false;
    bool fresh = false;  // not solved since it was eliminated
  };

  std::span<const std::uint32_t> VariablesOf(const Term& term) const {
    return {&term_variables_[term.begin], term.count};
  }
  void Touch(std::uint32_t variable);
  void TouchAll();
  void ForgetTouched();
  static double FlopsOf(const Front& front);
  std::span<const std::uint32_t> RowsOf(const Front& front) const {
    return std::span(front.variables).subspan(front.eliminated);
  }
  bool IsOpen(const Term& term) const;
  void SetParent(std::uint32_t child, std::uint32_t parent);
  void FindAffected();
  void Reorder(std::span<const std::uint32_t> last);
  std::vector<std::uint32_t> RingsAround(std::span<const std::uint32_t> centre,
                                         std::span<const std::uint32_t> open);
  std::vector<std::uint32_t> OpenVariables(std::vector<std::uint32_t>& orphans);
  VariableGraph GraphOfOpen(std::span<const std::uint32_t> open,
                            std::span<const std::uint32_t> orphans) const;
  void MakeFronts(const SymbolicTree& tree, std::span<const std::uint32_t> open);
  void RemoveAffected();
  std::uint32_t NewFront();
  void FindAffectedAndReorder(std::span<const std::uint32_t> last);
  bool EliminateAffected(bool keep_complements);
  void AddDiagonalOf(std::uint32_t variable, double* diagonal) const;
  bool IsDetermined(const Front& front);
  bool EliminateFront(Front& front, bool keep_complement);
  void Assemble(const Front& front, bool complements_are_kept);
  void FindRuns(std::span<const std::uint32_t> variables);
  void Scatter(std::span<const std::uint32_t> variables,
               const double* values,
               std::ptrdiff_t stride,
               std::ptrdiff_t size);
  void ScatterRuns(std::span<const std::uint32_t> variables,
                   const double* values,
                   std::ptrdiff_t stride,
                   std::ptrdiff_t size);
  void SolveFront(Front& front, double change_min);
  std::vector<std::uint32_t> PathOf(std::uint32_t variable) const;

  std::vector<Variable> variables_;
  std::vector<Term> terms_;
  std::vector<std::uint32_t> term_variables_;
  std::vector<Use> uses_;
  std::vector<double> term_values_;
  // By how many variables they are over, and of how many numbers.
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<std::uint32_t>> free_terms_;
  std::vector<std::uint32_t> going_variables_;  // until their fronts have gone
  std::vector<std::uint32_t> free_variables_;
  std::vector<Front> fronts_;
  std::vector<std::uint32_t> free_fronts_;
  std::uint64_t sequence_ = 0;
  double flops_ = 0.0;               // of one elimination of all, about
  double flops_in_one_order_ = 0.0;  // of that when all was ordered at once
  std::vector<double> value_;
  std::vector<double> spread_;        // the value with which the fronts below were solved
  std::vector<std::uint64_t> moved_;  // per variable: the round in which it moved
  std::uint64_t round_ = 0;
  std::vector<std::uint64_t> reached_;  // per variable: the last search that has come there
  std::uint64_t search_ = 0;

  std::vector<std::uint32_t> touched_;  // variables
  bool structure_changed_ = false;
  bool is_in_one_order_ = false;         // all fronts, by their sequence, are in postorder
  std::vector<std::uint32_t> affected_;  // fronts, children first
  std::vector<std::uint32_t> fresh_;     // fronts
  std::size_t eliminated_count_ = 0;
  class SparseRows;

  struct Run {
    std::ptrdiff_t source = 0;
    std::ptrdiff_t target = 0;
    std::ptrdiff_t count = 0;
  };
  std::vector<Run> runs_;
  NumberBuffer work_;   // the front at hand
  NumberBuffer stack_;  // complements that no parent has taken yet, of EliminateAll
  std::size_t stack_size_ = 0;
  bool complements_are_kept_ = true;
  std::vector<double> x_;
  double diagonal_max_ = 0.0;  // of all terms so far
};

}  // namespace loci
