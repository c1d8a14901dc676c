// SPDX-License-Identifier: Apache-2.0
// The threads that run handlers.
#include "server/rpc/worker_pool.h"

#include <algorithm>
#include <utility>

namespace loci {

WorkerPool::WorkerPool(std::size_t worker_count) {
  for (std::size_t i = 0; i < std::max<std::size_t>(worker_count, 1); ++i) {
    workers_.emplace_back([this] { Work(); });
  }
}

WorkerPool::~WorkerPool() {
  Stop();
}

void WorkerPool::Post(std::function<void()> task) {
  {
    const MutexLock lock(mutex_);
    if (stopping_) {
      return;
    }
    tasks_.push_back(std::move(task));
  }
  changed_.NotifyOne();
}

void WorkerPool::Stop() {
  std::deque<std::function<void()>> dropped;  // destroyed without the lock
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    dropped.swap(tasks_);
  }
  changed_.NotifyAll();
  for (std::thread& worker : workers_) {
    worker.join();
  }
  workers_.clear();
}

void WorkerPool::Work() {
  while (true) {
    std::function<void()> task;
    {
      const MutexLock lock(mutex_);
      while (tasks_.empty() && !stopping_) {
        changed_.Wait(mutex_);
      }
      if (stopping_) {
        return;
      }
      task = std::move(tasks_.front());
      tasks_.pop_front();
    }
    task();
  }
}

void Strand::Post(std::function<void()> task) {
  {
    const MutexLock lock(mutex_);
    tasks_.push_back(std::move(task));
    if (running_) {
      return;
    }
    running_ = true;
  }
  pool_.Post([self = shared_from_this()] { self->RunOne(); });
}

void Strand::RunOne() {
  std::function<void()> task;
  {
    const MutexLock lock(mutex_);
    task = std::move(tasks_.front());
    tasks_.pop_front();
  }
  task();
  {
    const MutexLock lock(mutex_);
    if (tasks_.empty()) {
      running_ = false;
      return;
    }
  }
  // Back of the queue: one busy peer does not keep a worker to itself.
  pool_.Post([self = shared_from_this()] { self->RunOne(); });
}

}  // namespace loci
