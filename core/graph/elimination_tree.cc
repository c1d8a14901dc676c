// SPDX-License-Identifier: Apache-2.0
// Terms, and which fronts they concern.
#include "core/graph/elimination_tree.h"

#include <algorithm>
#include <utility>

#include "core/base/check.h"
#include "core/graph/elimination_order.h"
#include "core/graph/ring_order.h"

namespace loci {
namespace {

// Reordering parts only makes the order of the whole worse in time. When elimination takes this
// many times what it took after the last order of the whole, there is a new one.
constexpr double kGrowthMax = 2.0;
// Of fewer variables than this all fronts are small, in whatever order.
constexpr std::size_t kVariablesForRings = 256;
// Rings spare the next closures work, and may cost this one so many times what least fill would; of
// fewer variables the difference is not worth a second order.
constexpr double kRingCostMax = 2.0;
constexpr std::size_t kVariablesForComparison = 256;
// The search for distances gives up when it has seen this many times what it looks for.
constexpr std::size_t kVisitsPerOpen = 64;

// Of eliminating all, in cubes of a variable's size.
double CostOf(const SymbolicTree& tree) {
  double cost = 0.0;
  for (const SymbolicFront& front : tree.fronts) {
    const auto size = static_cast<double>(front.columns + front.rows);
    cost += front.columns * size * size;
  }
  return cost;
}

}  // namespace

void EliminationTree::Reserve(std::size_t variables, std::size_t terms) {
  variables_.reserve(variables);
  value_.reserve(3 * variables);
  spread_.reserve(3 * variables);
  moved_.reserve(variables);
  touched_.reserve(variables);
  fronts_.reserve(variables);
  terms_.reserve(terms + variables);
  term_variables_.reserve(2 * terms + variables);
  uses_.reserve(2 * terms + variables);
  term_values_.reserve(42 * terms + 12 * variables);
}

EliminationTree EliminationTree::Resized(int size) const {
  LOCI_CHECK(size > 0 && !structure_changed_);
  const auto width = static_cast<std::uint32_t>(size);
  EliminationTree tree;
  tree.variables_ = variables_;
  for (std::uint32_t i = 0; i < variables_.size(); ++i) {
    tree.variables_[i].size = size;
    tree.variables_[i].offset = i * width;
    tree.variables_[i].touched = false;
  }
  tree.value_.resize(variables_.size() * width, 0.0);
  tree.spread_.resize(tree.value_.size(), 0.0);
  tree.moved_.resize(variables_.size(), 0);
  tree.terms_ = terms_;
  tree.term_variables_ = term_variables_;
  tree.uses_ = uses_;
  for (const auto& [kind, free] : free_terms_) {
    tree.free_terms_[{kind.first, kind.first * width}] = free;
  }
  tree.free_variables_ = free_variables_;
  std::uint32_t values = 0;
  for (Term& term : tree.terms_) {
    term.size = term.count * width;
    term.values = std::exchange(values, values + term.size * (term.size + 1));
  }
  tree.term_values_.resize(values, 0.0);
  tree.fronts_.resize(fronts_.size());
  for (std::size_t i = 0; i < fronts_.size(); ++i) {
    Front& front = tree.fronts_[i];
    front.variables = fronts_[i].variables;
    front.eliminated = fronts_[i].eliminated;
    front.columns = front.eliminated * width;
    front.size = static_cast<std::uint32_t>(front.variables.size()) * width;
    front.parent = fronts_[i].parent;
    front.children = fronts_[i].children;
    front.sequence = fronts_[i].sequence;
  }
  for (const std::uint32_t free : free_fronts_) {
    tree.fronts_[free].size = 0;
  }
  for (const Front& front : tree.fronts_) {
    tree.flops_ += FlopsOf(front);
  }
  tree.flops_in_one_order_ = tree.flops_;
  tree.free_fronts_ = free_fronts_;
  tree.sequence_ = sequence_;
  tree.is_in_one_order_ = is_in_one_order_;
  tree.TouchAll();
  return tree;
}

std::uint32_t EliminationTree::AddVariable(int size) {
  LOCI_CHECK(size > 0);
  structure_changed_ = true;
  for (std::size_t i = free_variables_.size(); i-- > 0;) {
    const std::uint32_t free = free_variables_[i];
    if (variables_[free].size == size) {
      free_variables_.erase(free_variables_.begin() + static_cast<std::ptrdiff_t>(i));
      variables_[free].gone = false;
      ResetValue(free);
      Touch(free);
      return free;
    }
  }
  const auto variable = static_cast<std::uint32_t>(variables_.size());
  variables_.emplace_back();
  variables_.back().size = size;
  variables_.back().offset = static_cast<std::uint32_t>(value_.size());
  value_.resize(value_.size() + static_cast<std::size_t>(size), 0.0);
  spread_.resize(value_.size(), 0.0);
  moved_.push_back(0);
  Touch(variable);
  return variable;
}

void EliminationTree::RemoveVariable(std::uint32_t variable) {
  LOCI_CHECK(!variables_[variable].gone && variables_[variable].first_use == kNone);
  variables_[variable].gone = true;
  going_variables_.push_back(variable);
  Touch(variable);
  structure_changed_ = true;
}

std::uint32_t EliminationTree::AddTerm(std::span<const std::uint32_t> variables) {
  std::uint32_t size = 0;
  for (const std::uint32_t variable : variables) {
    size += static_cast<std::uint32_t>(variables_[variable].size);
  }
  std::uint32_t index = kNone;
  std::vector<std::uint32_t>& free = free_terms_[{variables.size(), size}];
  if (!free.empty()) {
    index = free.back();
    free.pop_back();
  } else {
    index = static_cast<std::uint32_t>(terms_.size());
    Term term;
    term.begin = static_cast<std::uint32_t>(term_variables_.size());
    term.count = static_cast<std::uint32_t>(variables.size());
    term.values = static_cast<std::uint32_t>(term_values_.size());
    term.size = size;
    term_variables_.resize(term_variables_.size() + variables.size());
    uses_.resize(term_variables_.size());
    term_values_.resize(term_values_.size() + std::size_t{size} * (size + 1));
    terms_.push_back(term);
  }
  const Term& term = terms_[index];
  std::copy(variables.begin(), variables.end(), term_variables_.begin() + term.begin);
  std::fill_n(term_values_.begin() + term.values, std::size_t{size} * (size + 1), 0.0);
  for (std::uint32_t i = 0; i < term.count; ++i) {
    Variable& variable = variables_[variables[i]];
    uses_[term.begin + i] = {index, variable.first_use};
    variable.first_use = term.begin + i;
    Touch(variables[i]);
  }
  if (variables.size() == 1) {
    terms_[index].first = variables.front();
  } else {
    structure_changed_ = true;
  }
  return index;
}

double* EliminationTree::SetTerm(std::uint32_t index) {
  const Term& term = terms_[index];
  for (const std::uint32_t variable : VariablesOf(term)) {
    Touch(variable);
  }
  return &term_values_[term.values];
}

void EliminationTree::TouchAll() {
  for (std::uint32_t variable = 0; variable < variables_.size(); ++variable) {
    if (!variables_[variable].gone) {
      Touch(variable);
    }
  }
}

void EliminationTree::ForgetTouched() {
  for (const std::uint32_t variable : touched_) {
    variables_[variable].touched = false;
  }
  touched_.clear();
}

void EliminationTree::RemoveTerm(std::uint32_t index) {
  for (const std::uint32_t variable : VariablesOf(terms_[index])) {
    std::uint32_t* link = &variables_[variable].first_use;
    while (uses_[*link].term != index) {
      link = &uses_[*link].next;
    }
    *link = uses_[*link].next;
    Touch(variable);
  }
  structure_changed_ = true;
  free_terms_[{terms_[index].count, terms_[index].size}].push_back(index);
}

void EliminationTree::Touch(std::uint32_t variable) {
  if (!variables_[variable].touched) {
    variables_[variable].touched = true;
    touched_.push_back(variable);
  }
}

void EliminationTree::ResetValue(std::uint32_t variable) {
  const Variable& v = variables_[variable];
  std::fill_n(value_.begin() + v.offset, v.size, 0.0);
  std::fill_n(spread_.begin() + v.offset, v.size, 0.0);
}

// All fronts that eliminate a touched variable, and all above them; children first.
void EliminationTree::FindAffected() {
  affected_.clear();
  for (const std::uint32_t variable : touched_) {
    std::uint32_t front = variables_[variable].front;
    while (front != kNone && !fronts_[front].affected) {
      fronts_[front].affected = true;
      affected_.push_back(front);
      front = fronts_[front].parent;
    }
  }
  std::sort(affected_.begin(), affected_.end(), [this](std::uint32_t a, std::uint32_t b) {
    return fronts_[a].sequence < fronts_[b].sequence;
  });
}

double EliminationTree::FlopsOf(const Front& front) {
  return static_cast<double>(front.columns) * front.size * front.size;
}

bool EliminationTree::Eliminate(std::span<const std::uint32_t> last) {
  eliminated_count_ = 0;
  if (!complements_are_kept_) {
    TouchAll();
    complements_are_kept_ = true;
  }
  if (touched_.empty()) {
    return true;
  }
  FindAffectedAndReorder(last);
  return EliminateAffected(true);
}

void EliminationTree::Order() {
  TouchAll();
  structure_changed_ = structure_changed_ || !is_in_one_order_;
  FindAffectedAndReorder({});
  for (const std::uint32_t front : affected_) {
    fronts_[front].affected = false;
  }
  TouchAll();
}

bool EliminationTree::EliminateAll() {
  eliminated_count_ = 0;
  structure_changed_ = structure_changed_ || !is_in_one_order_;
  complements_are_kept_ = false;
  stack_size_ = 0;
  if (!structure_changed_ && affected_.size() + free_fronts_.size() == fronts_.size()) {
    ForgetTouched();  // all fronts were affected before, and are again
  } else {
    TouchAll();
    FindAffectedAndReorder({});
  }
  return EliminateAffected(false);
}

void EliminationTree::FindAffectedAndReorder(std::span<const std::uint32_t> last) {
  const bool is_bloated = structure_changed_ && flops_ > kGrowthMax * flops_in_one_order_;
  if (is_bloated) {
    TouchAll();
  }
  FindAffected();
  if (structure_changed_) {
    Reorder(last);
    flops_in_one_order_ = is_in_one_order_ ? flops_ : std::min(flops_in_one_order_, flops_);
  }
  ForgetTouched();
  structure_changed_ = false;
}

bool EliminationTree::EliminateAffected(bool keep_complements) {
  for (const std::uint32_t front : affected_) {
    fronts_[front].affected = false;
    if (!fronts_[front].fresh) {
      fronts_[front].fresh = true;
      fresh_.push_back(front);
    }
  }
  bool determined = true;
  for (const std::uint32_t front : affected_) {
    eliminated_count_ += fronts_[front].eliminated;
    determined = determined && EliminateFront(fronts_[front], keep_complements);
  }
  if (!determined) {  // all of it is due again
    for (const std::uint32_t front : affected_) {
      for (std::uint32_t i = 0; i < fronts_[front].eliminated; ++i) {
        Touch(fronts_[front].variables[i]);
      }
    }
  }
  return determined;
}

std::uint32_t EliminationTree::NewFront() {
  std::uint32_t index = 0;
  if (free_fronts_.empty()) {
    index = static_cast<std::uint32_t>(fronts_.size());
    fronts_.emplace_back();
  } else {
    index = free_fronts_.back();
    free_fronts_.pop_back();
  }
  Front& front = fronts_[index];
  front.variables.clear();
  front.children.clear();
  front.parent = kNone;
  front.size = 0;
  front.sequence = ++sequence_;
  front.affected = false;
  front.fresh = false;
  return index;
}

// Takes the affected fronts out, and puts new ones in their place for their variables and those
// that have none yet.
void EliminationTree::Reorder(std::span<const std::uint32_t> last) {
  std::vector<std::uint32_t> orphans;  // fronts that lose their parents
  const std::vector<std::uint32_t> open = OpenVariables(orphans);
  is_in_one_order_ = open.size() + free_variables_.size() == variables_.size();
  const VariableGraph graph = GraphOfOpen(open, orphans);
  std::vector<std::uint32_t> last_open;
  for (const std::uint32_t variable : last) {
    const Variable& v = variables_[variable];
    LOCI_CHECK(!v.gone);
    if (v.front == kNone &&
        std::find(last_open.begin(), last_open.end(), v.row) == last_open.end()) {
      last_open.push_back(v.row);
    }
  }
  // An order of the whole stands for long, wherever the next changes are.
  const bool by_rings =
      !last_open.empty() && !is_in_one_order_ && variables_.size() >= kVariablesForRings;
  SymbolicTree tree =
      AnalyseElimination(graph,
                         by_rings ? OrderByRings(graph, RingsAround(last_open, open))
                                  : EliminationOrder(graph, last_open));
  if (by_rings && open.size() >= kVariablesForComparison) {
    SymbolicTree of_least_fill = AnalyseElimination(graph, EliminationOrder(graph, last_open));
    if (CostOf(tree) > kRingCostMax * CostOf(of_least_fill)) {
      tree = std::move(of_least_fill);
    }
  }

  RemoveAffected();
  MakeFronts(tree, open);
  // What comes first of some variables, all of them open.
  const auto first_of = [&](std::span<const std::uint32_t> variables) {
    return *std::min_element(
        variables.begin(), variables.end(), [&](std::uint32_t a, std::uint32_t b) {
          return tree.position[variables_[a].row] < tree.position[variables_[b].row];
        });
  };
  for (const std::uint32_t orphan : orphans) {
    const std::span<const std::uint32_t> rows = RowsOf(fronts_[orphan]);
    if (!rows.empty()) {
      SetParent(orphan, affected_[tree.front_of[variables_[first_of(rows)].row]]);
    }
  }
  for (const std::uint32_t variable : open) {
    for (std::uint32_t use = variables_[variable].first_use; use != kNone; use = uses_[use].next) {
      Term& term = terms_[uses_[use].term];
      if (IsOpen(term)) {
        term.first = first_of(VariablesOf(term));
      }
    }
  }
  for (const std::uint32_t variable : open) {
    variables_[variable].front = affected_[tree.front_of[variables_[variable].row]];
  }
}

// The ring of each open variable, by how many terms are between it and the centre: each ring ends
// twice as far away as the one before it. What is nowhere near is beyond all of them.
std::vector<std::uint32_t> EliminationTree::RingsAround(std::span<const std::uint32_t> centre,
                                                        std::span<const std::uint32_t> open) {
  std::vector<std::uint32_t> ring(open.size(), kNone);
  reached_.resize(variables_.size(), 0);
  ++search_;
  std::vector<std::uint32_t> found;
  for (const std::uint32_t row : centre) {
    found.push_back(open[row]);
    reached_[open[row]] = search_;
  }
  std::size_t missing = open.size();
  std::size_t same_distance_end = found.size();
  std::uint32_t distance = 0;
  std::uint32_t ring_at = 0;
  std::uint32_t ring_end = 0;
  const std::size_t visits_max = kVisitsPerOpen * open.size();
  for (std::size_t i = 0; i < found.size() && i < visits_max && missing > 0; ++i) {
    if (i == same_distance_end) {
      same_distance_end = found.size();
      ++distance;
      if (distance > ring_end) {
        ring_end = 2 * ring_end + 1;
        ++ring_at;
      }
    }
    const Variable& variable = variables_[found[i]];
    if (variable.front == kNone) {
      ring[variable.row] = ring_at;
      --missing;
    }
    for (std::uint32_t use = variable.first_use; use != kNone; use = uses_[use].next) {
      for (const std::uint32_t other : VariablesOf(terms_[uses_[use].term])) {
        if (reached_[other] != search_) {
          reached_[other] = search_;
          found.push_back(other);
        }
      }
    }
  }
  std::replace(ring.begin(), ring.end(), kNone, ring_at + 1);
  return ring;
}

void EliminationTree::MakeFronts(const SymbolicTree& tree, std::span<const std::uint32_t> open) {
  for (const SymbolicFront& symbolic : tree.fronts) {
    const std::uint32_t index = NewFront();
    affected_.push_back(index);
    Front& front = fronts_[index];
    front.eliminated = symbolic.columns;
    front.variables.reserve(symbolic.columns + symbolic.rows);
    for (std::uint32_t i = 0; i < symbolic.columns + symbolic.rows; ++i) {
      if (i == symbolic.columns) {
        front.columns = front.size;
      }
      const std::uint32_t variable = open[tree.variables[symbolic.begin + i]];
      front.variables.push_back(variable);
      front.size += static_cast<std::uint32_t>(variables_[variable].size);
    }
    front.columns = symbolic.rows == 0 ? front.size : front.columns;
    flops_ += FlopsOf(front);
  }
  for (std::size_t i = 0; i < tree.fronts.size(); ++i) {
    if (tree.fronts[i].parent != kNone) {
      SetParent(affected_[i], affected_[tree.fronts[i].parent]);
    }
  }
}

// The variables of the affected fronts, which they lose, and those that have no front, ascending;
// each remembers its number among them in `row`. Those that were removed are not among them: all
// fronts that know them are affected, since what removed their terms has touched all whose
// elimination joined them to others.
std::vector<std::uint32_t> EliminationTree::OpenVariables(std::vector<std::uint32_t>& orphans) {
  std::vector<std::uint32_t> open;
  for (const std::uint32_t variable : touched_) {
    if (variables_[variable].front == kNone) {
      open.push_back(variable);
    }
  }
  for (const std::uint32_t index : affected_) {
    const Front& front = fronts_[index];
    open.insert(open.end(), front.variables.begin(), front.variables.begin() + front.eliminated);
    for (const std::uint32_t child : front.children) {
      if (!fronts_[child].affected) {
        fronts_[child].parent = kNone;
        orphans.push_back(child);
      }
    }
  }
  for (const std::uint32_t variable : going_variables_) {
    variables_[variable].front = kNone;
  }
  free_variables_.insert(free_variables_.end(), going_variables_.begin(), going_variables_.end());
  going_variables_.clear();
  std::erase_if(open, [this](std::uint32_t variable) { return variables_[variable].gone; });
  std::sort(open.begin(), open.end());
  for (std::uint32_t i = 0; i < open.size(); ++i) {
    variables_[open[i]].row = i;
    variables_[open[i]].front = kNone;
  }
  return open;
}

// A term whose variables are not all open is in the Schur complement of an orphan.
bool EliminationTree::IsOpen(const Term& term) const {
  const std::span<const std::uint32_t> variables = VariablesOf(term);
  return std::all_of(variables.begin(), variables.end(), [this](std::uint32_t variable) {
    return variables_[variable].front == kNone;
  });
}

VariableGraph EliminationTree::GraphOfOpen(std::span<const std::uint32_t> open,
                                           std::span<const std::uint32_t> orphans) const {
  VariableGraph graph;
  graph.count = static_cast<std::uint32_t>(open.size());
  for (std::uint32_t i = 0; i < graph.count; ++i) {
    for (std::uint32_t use = variables_[open[i]].first_use; use != kNone; use = uses_[use].next) {
      const Term& term = terms_[uses_[use].term];
      if (term.count < 2 || !IsOpen(term)) {
        continue;
      }
      for (const std::uint32_t other : VariablesOf(term)) {
        if (other > open[i]) {
          graph.edges.emplace_back(i, variables_[other].row);
        }
      }
    }
  }
  for (const std::uint32_t orphan : orphans) {
    std::vector<std::uint32_t> clique;
    for (const std::uint32_t variable : RowsOf(fronts_[orphan])) {
      clique.push_back(variables_[variable].row);
    }
    if (clique.size() > 1) {
      graph.cliques.push_back(std::move(clique));
    }
  }
  return graph;
}

void EliminationTree::SetParent(std::uint32_t child, std::uint32_t parent) {
  fronts_[child].parent = parent;
  fronts_[parent].children.push_back(child);
}

void EliminationTree::RemoveAffected() {
  for (const std::uint32_t index : affected_) {
    Front& front = fronts_[index];
    front.affected = false;
    front.fresh = false;
    flops_ -= FlopsOf(front);
    free_fronts_.push_back(index);
  }
  affected_.clear();
  std::erase_if(fresh_, [this](std::uint32_t front) { return !fronts_[front].fresh; });
}

}  // namespace loci
