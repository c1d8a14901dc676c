// SPDX-License-Identifier: Apache-2.0
// Rho and its derivative, kernel by kernel.
#include "core/graph/robust_kernel.h"

#include <cmath>

#include "core/base/math.h"

namespace loci {

double RobustKernel::Rho(double chi2) const {
  const double width_squared = width_sigmas * width_sigmas;
  switch (shape) {
    case Shape::kNone:
      return chi2;
    case Shape::kHuber:
      return chi2 <= width_squared ? chi2 : 2.0 * width_sigmas * std::sqrt(chi2) - width_squared;
    case Shape::kCauchy:
      return width_squared * Log(1.0 + chi2 / width_squared);
    case Shape::kGemanMcClure:
      return width_squared * chi2 / (width_squared + chi2);
    case Shape::kDynamicCovariance:
      return chi2 <= width_squared
                 ? chi2
                 : width_squared * (3.0 * chi2 - width_squared) / (chi2 + width_squared);
  }
  return chi2;
}

double RobustKernel::Weight(double chi2) const {
  const double width_squared = width_sigmas * width_sigmas;
  switch (shape) {
    case Shape::kNone:
      return 1.0;
    case Shape::kHuber:
      return chi2 <= width_squared ? 1.0 : width_sigmas / std::sqrt(chi2);
    case Shape::kCauchy:
      return 1.0 / (1.0 + chi2 / width_squared);
    case Shape::kGemanMcClure: {
      const double part = width_squared / (width_squared + chi2);
      return part * part;
    }
    case Shape::kDynamicCovariance: {
      const double scale =
          chi2 <= width_squared ? 1.0 : 2.0 * width_squared / (width_squared + chi2);
      return scale * scale;
    }
  }
  return 1.0;
}

}  // namespace loci
