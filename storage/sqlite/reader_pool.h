// SPDX-License-Identifier: Apache-2.0
// Connections for readers, kept for the next one.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status.h"
#include "storage/sqlite/connection.h"

namespace loci {

// Thread-safe. Each reader has a connection of its own: readers wait neither for each other nor for
// the writer.
class ReaderPool {
 public:
  // A connection while it is in use. It must not outlive its pool.
  class Lease {
   public:
    Lease(ReaderPool* pool, std::unique_ptr<Connection> connection)
        : pool_(pool), connection_(std::move(connection)) {}
    ~Lease() {
      if (connection_ != nullptr) {
        pool_->Return(std::move(connection_));
      }
    }
    Lease(Lease&& other) noexcept = default;
    Lease& operator=(Lease&& other) = delete;
    Connection& operator*() const { return *connection_; }

   private:
    ReaderPool* pool_;
    std::unique_ptr<Connection> connection_;
  };

  ReaderPool(std::filesystem::path file, std::string vfs)
      : file_(std::move(file)), vfs_(std::move(vfs)) {}

  StatusOr<Lease> Take();

 private:
  void Return(std::unique_ptr<Connection> connection);

  const std::filesystem::path file_;
  const std::string vfs_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<Connection>> idle_;
};

}  // namespace loci
