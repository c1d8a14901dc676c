// SPDX-License-Identifier: Apache-2.0
// The public pose graphs among the data sets, with the best chi2 that anyone knows of each.
#pragma once

#include <array>
#include <ostream>
#include <string>

#include <gtest/gtest.h>

namespace loci {

struct PublicGraph {
  const char* name;
  const char* file;  // for ReadDataset
  double best_chi2;
};

// From the table of the data sets' page. Plain Gauss-Newton from odometry ends in local minima of
// the last five, at many times the best.
inline constexpr std::array kPublicGraphs = {
    PublicGraph{"intel_g2o", "graphs/intel_g2o.g2o.gz", 546.461},
    PublicGraph{"intel", "graphs/intel.g2o.gz", 45.0047},
    PublicGraph{"CSAIL", "graphs/CSAIL.g2o.gz", 40.5551},
    PublicGraph{"M3500", "graphs/M3500.g2o.gz", 137.913},
    PublicGraph{"manhattanOlson3500", "graphs/manhattanOlson3500.g2o.gz", 146.077},
    PublicGraph{"city10000", "graphs/city10000.g2o.gz", 511.985},
    PublicGraph{"cityTrees10000", "graphs/cityTrees10000.txt.gz", 8668.93},
    PublicGraph{"sphere2500", "graphs/sphere2500.g2o.gz", 727.150},
    PublicGraph{"parking_garage", "graphs/parking-garage.g2o.gz", 1.23869},
    PublicGraph{"smallGrid3D", "graphs/smallGrid3D.g2o.gz", 458.154},
    PublicGraph{"MIT", "graphs/MIT.g2o.gz", 41.1633},
    PublicGraph{"INTEL_carlone", "graphs/INTEL_carlone.g2o.gz", 215.837},
    PublicGraph{"M3500a", "graphs/M3500a.g2o.gz", 912.115},
    PublicGraph{"victoriaPark", "graphs/victoriaPark.txt.gz", 6184.12},
    PublicGraph{"victoriaPark_full", "victoria_park/victoriaPark-full.g2o.gz", 389.787}};

inline void PrintTo(const PublicGraph& graph, std::ostream* out) {
  *out << graph.name;
}

inline std::string NameOfPublicGraph(const testing::TestParamInfo<PublicGraph>& info) {
  return info.param.name;
}

}  // namespace loci
