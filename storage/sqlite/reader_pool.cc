// SPDX-License-Identifier: Apache-2.0
#include "storage/sqlite/reader_pool.h"

namespace loci {
namespace {

// More readers at once open a connection each; opening takes a tenth of a millisecond.
constexpr std::size_t kIdleCountMax = 4;

}  // namespace

StatusOr<ReaderPool::Lease> ReaderPool::Take() {
  {
    const std::lock_guard held(mutex_);
    if (!idle_.empty()) {
      Lease lease(this, std::move(idle_.back()));
      idle_.pop_back();
      return lease;
    }
  }
  LOCI_ASSIGN_OR_RETURN(std::unique_ptr<Connection> connection,
                        Connection::Open(file_, Access::kRead, vfs_));
  return Lease(this, std::move(connection));
}

void ReaderPool::Return(std::unique_ptr<Connection> connection) {
  const std::lock_guard held(mutex_);
  if (idle_.size() < kIdleCountMax) {
    idle_.push_back(std::move(connection));
  }
}

}  // namespace loci
