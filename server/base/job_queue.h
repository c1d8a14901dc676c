// SPDX-License-Identifier: Apache-2.0
// Threads for work that takes seconds, so that the workers of calls stay free.
#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "core/base/status.h"
#include "server/base/mutex.h"

namespace loci {

// Runs jobs in the order given, `thread_count` at a time. Thread-safe.
class JobQueue {
 public:
  using Job = std::function<void()>;

  // `name` is for messages. At most `waiting_max` jobs wait beside those that run.
  JobQueue(std::string name, std::size_t thread_count, std::size_t waiting_max);
  JobQueue(const JobQueue&) = delete;
  JobQueue& operator=(const JobQueue&) = delete;
  // Drops the jobs that wait and joins those that run.
  ~JobQueue();

  // kResourceExhausted if too many wait; the job is then dropped.
  Status Submit(Job job) LOCI_EXCLUDES(mutex_);

 private:
  void Run() LOCI_EXCLUDES(mutex_);

  const std::string name_;
  const std::size_t thread_count_;
  const std::size_t waiting_max_;
  Mutex mutex_;
  ConditionVariable wake_;
  std::deque<Job> waiting_ LOCI_GUARDED_BY(mutex_);
  std::size_t idle_ LOCI_GUARDED_BY(mutex_);
  bool stopping_ LOCI_GUARDED_BY(mutex_) = false;
  std::vector<std::thread> threads_;
};

}  // namespace loci
