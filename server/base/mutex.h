// SPDX-License-Identifier: Apache-2.0
// A mutex whose use clang checks at compile time (-Wthread-safety, preset `tidy`).
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>

#if defined(__clang__)
#define LOCI_THREAD_ANNOTATION(x) __attribute__((x))
#else
#define LOCI_THREAD_ANNOTATION(x)
#endif

// On a member: it is read and written only while the mutex is held.
#define LOCI_GUARDED_BY(mutex) LOCI_THREAD_ANNOTATION(guarded_by(mutex))
// On a function: the caller holds the mutex.
#define LOCI_REQUIRES(...) LOCI_THREAD_ANNOTATION(requires_capability(__VA_ARGS__))
// On a function: the caller does not hold the mutex; it is taken inside.
#define LOCI_EXCLUDES(...) LOCI_THREAD_ANNOTATION(locks_excluded(__VA_ARGS__))

namespace loci {

class LOCI_THREAD_ANNOTATION(capability("mutex")) Mutex {
 public:
  Mutex() = default;
  Mutex(const Mutex&) = delete;
  Mutex& operator=(const Mutex&) = delete;

  void Lock() LOCI_THREAD_ANNOTATION(acquire_capability()) { mutex_.lock(); }
  void Unlock() LOCI_THREAD_ANNOTATION(release_capability()) { mutex_.unlock(); }

 private:
  friend class ConditionVariable;
  std::mutex mutex_;
};

// Holds a mutex from here to the end of the block.
class LOCI_THREAD_ANNOTATION(scoped_lockable) MutexLock {
 public:
  explicit MutexLock(Mutex& mutex) LOCI_THREAD_ANNOTATION(acquire_capability(mutex))
      : mutex_(mutex) {
    mutex_.Lock();
  }
  ~MutexLock() LOCI_THREAD_ANNOTATION(release_capability()) { mutex_.Unlock(); }
  MutexLock(const MutexLock&) = delete;
  MutexLock& operator=(const MutexLock&) = delete;

 private:
  Mutex& mutex_;
};

// Waits give the mutex back meanwhile and may wake for nothing: call them in a loop over the
// condition itself, in which clang sees that the guarded members are read under the mutex.
class ConditionVariable {
 public:
  void NotifyOne() { condition_.notify_one(); }
  void NotifyAll() { condition_.notify_all(); }

  void Wait(Mutex& mutex) LOCI_REQUIRES(mutex) {
    std::unique_lock<std::mutex> lock(mutex.mutex_, std::adopt_lock);
    condition_.wait(lock);
    lock.release();
  }

  // False when `deadline` has passed.
  bool WaitUntil(Mutex& mutex, std::chrono::steady_clock::time_point deadline)
      LOCI_REQUIRES(mutex) {
    std::unique_lock<std::mutex> lock(mutex.mutex_, std::adopt_lock);
    const bool in_time = condition_.wait_until(lock, deadline) == std::cv_status::no_timeout;
    lock.release();
    return in_time;
  }

 private:
  std::condition_variable condition_;
};

}  // namespace loci
