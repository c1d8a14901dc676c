// SPDX-License-Identifier: Apache-2.0
#include "server/base/job_queue.h"

#include <utility>

namespace loci {

JobQueue::JobQueue(std::string name, std::size_t thread_count, std::size_t waiting_max)
    : name_(std::move(name)),
      thread_count_(thread_count),
      waiting_max_(waiting_max),
      idle_(thread_count) {
  for (std::size_t i = 0; i < thread_count; ++i) {
    threads_.emplace_back([this] { Run(); });
  }
}

JobQueue::~JobQueue() {
  std::deque<Job> dropped;
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    dropped.swap(waiting_);
    wake_.NotifyAll();
  }
  dropped.clear();  // whoever waits for one of them need not wait for those that run
  for (std::thread& thread : threads_) {
    thread.join();
  }
}

Status JobQueue::Submit(Job job) {
  const MutexLock lock(mutex_);
  if (waiting_.size() >= idle_ + waiting_max_) {
    return ResourceExhaustedError(name_ + ": " + std::to_string(thread_count_) + " run and " +
                                  std::to_string(waiting_max_) +
                                  " wait already, which is the limit; call again later");
  }
  waiting_.push_back(std::move(job));
  wake_.NotifyOne();
  return {};
}

void JobQueue::Run() {
  for (;;) {
    Job job;
    {
      const MutexLock lock(mutex_);
      while (waiting_.empty() && !stopping_) {
        wake_.Wait(mutex_);
      }
      if (stopping_) {
        return;
      }
      job = std::move(waiting_.front());
      waiting_.pop_front();
      --idle_;
    }
    job();
    job = nullptr;  // what it holds goes before the thread counts as idle
    const MutexLock lock(mutex_);
    ++idle_;
  }
}

}  // namespace loci
