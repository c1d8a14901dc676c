// SPDX-License-Identifier: Apache-2.0
// Robust kernels: how much a constraint may pull that does not fit.
#pragma once

#include <cstdint>

namespace loci {

// rho(s) of s = e^T Omega e. Below the width it is nearly s; above, it grows slower.
//
// Geman and McClure's with a width that falls is what graduated non-convexity minimises (Yang,
// Antonante, Tzoumas, Carlone: "Graduated Non-Convexity for Robust Spatial Perception", RA-L 2020;
// their mu c^2 is the square of the width). Dynamic covariance scaling (Agarwal, Tipaldi, Spinello,
// Stachniss, Burgard: "Robust Map Optimization using Dynamic Covariance Scaling", ICRA 2013; their
// Phi is the square of the width) weighs by the square of min(1, 2 Phi / (Phi + s)).
struct RobustKernel {
  enum class Shape : std::uint8_t {
    kNone,               // rho(s) = s
    kHuber,              // 2 w sqrt(s) - w^2 above w: an outlier pulls with a constant force
    kCauchy,             // w^2 log(1 + s / w^2): an outlier's pull falls to 0
    kGemanMcClure,       // w^2 s / (w^2 + s): the same, and rho stays below w^2
    kDynamicCovariance,  // w^2 (3 s - w^2) / (s + w^2) above w: the same, below 3 w^2
  };
  Shape shape = Shape::kNone;
  double width_sigmas = 1.0;  // w, > 0; where e is about w standard deviations

  double Rho(double chi2) const;
  double Weight(double chi2) const;  // the derivative of rho, in (0, 1]
};

}  // namespace loci
