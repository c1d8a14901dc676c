// SPDX-License-Identifier: Apache-2.0
// The threads that run handlers.
#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "server/base/mutex.h"

namespace loci {

// Runs tasks in the order in which they are posted, on a fixed number of threads. Its queue is
// bounded by who posts: the number of calls in flight.
class WorkerPool {
 public:
  explicit WorkerPool(std::size_t worker_count);
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;
  ~WorkerPool();

  // Any thread. After Stop the task is dropped.
  void Post(std::function<void()> task);

  // Waits for the tasks that run and drops those that wait. Not to be called by a task.
  void Stop();

 private:
  void Work();

  Mutex mutex_;
  ConditionVariable changed_;
  std::deque<std::function<void()>> tasks_ LOCI_GUARDED_BY(mutex_);
  bool stopping_ LOCI_GUARDED_BY(mutex_) = false;
  std::vector<std::thread> workers_;
};

// Runs its tasks on a pool, one after the other and in order. Lives until the last has run.
class Strand : public std::enable_shared_from_this<Strand> {
 public:
  explicit Strand(WorkerPool& pool) : pool_(pool) {}
  void Post(std::function<void()> task);

 private:
  void RunOne();

  WorkerPool& pool_;
  Mutex mutex_;
  std::deque<std::function<void()>> tasks_ LOCI_GUARDED_BY(mutex_);
  bool running_ LOCI_GUARDED_BY(mutex_) = false;
};

}  // namespace loci
