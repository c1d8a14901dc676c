// SPDX-License-Identifier: Apache-2.0
// Invariants: what only an error of ours can break.
#pragma once

namespace loci::internal {

[[noreturn]] void CheckFailed(const char* file, int line, const char* condition);

}  // namespace loci::internal

// Ends the process if `condition` is false, in every build type: for errors of ours, never for bad
// input.
#define LOCI_CHECK(condition)                                        \
  do {                                                               \
    if (!(condition)) {                                              \
      ::loci::internal::CheckFailed(__FILE__, __LINE__, #condition); \
    }                                                                \
  } while (false)

// The same, for loops over cells: only in builds without NDEBUG.
#ifdef NDEBUG
#define LOCI_DCHECK(condition) \
  do {                         \
  } while (false)
#else
#define LOCI_DCHECK(condition) LOCI_CHECK(condition)
#endif
