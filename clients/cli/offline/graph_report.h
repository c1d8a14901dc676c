// SPDX-License-Identifier: Apache-2.0
// What `loci graph optimize` says about a graph and its optimisation.
#pragma once

#include <string>

#include "clients/cli/offline/graph_solving.h"
#include "core/graph/g2o_format.h"

namespace loci::cli {

struct GraphReport {
  std::string in;
  std::string out;
  std::string method;
  std::string robust;
  SolveReport solve;
  double read_s = 0.0;
  double write_s = 0.0;
};

// One line. `graph` is the result, without refused closures, and so are the counts.
std::string JsonOf(const GraphReport& report, const G2oGraph& graph);
// For people.
std::string TextOf(const GraphReport& report, const G2oGraph& graph);

// "3 other records (2 ROBOTLASER1, 1 EQUIV)"; "0 other records".
std::string SkippedText(const G2oGraph& graph);

}  // namespace loci::cli
