// SPDX-License-Identifier: Apache-2.0
// A program of ours as a process: run to its end, or beside the test.
#pragma once

#include <array>
#include <chrono>
#include <csignal>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/support/temporary_directory.h"

namespace loci {

class Program {
 public:
  explicit Program(const std::vector<std::string>& words) {
    std::vector<char*> arguments;
    for (const std::string& word : words) {
      arguments.push_back(const_cast<char*>(word.c_str()));
    }
    arguments.push_back(nullptr);
    const std::string out = (files_.path() / "out").string();
    const std::string error = (files_.path() / "error").string();
    pid_ = ::fork();
    if (pid_ == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // it does not outlive a test that crashes
      ::dup2(::open(out.c_str(), O_CREAT | O_WRONLY | O_APPEND, 0600), STDOUT_FILENO);
      ::dup2(::open(error.c_str(), O_CREAT | O_WRONLY | O_APPEND, 0600), STDERR_FILENO);
      ::execv(arguments[0], arguments.data());
      ::_exit(127);
    }
    // Not through glibc 2.36, whose header gives pidfd_open C++ linkage.
    pidfd_ = static_cast<int>(::syscall(SYS_pidfd_open, pid_, 0));
    EXPECT_GE(pidfd_, 0);
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
  ~Program() {
    if (!ended_) {
      End(SIGKILL);
    }
    ::close(pidfd_);
  }

  // Whether it ends within `limit`.
  bool Ends(std::chrono::milliseconds limit) {
    pollfd waiting{.fd = pidfd_, .events = POLLIN, .revents = 0};
    return ended_ || ::poll(&waiting, 1, static_cast<int>(limit.count())) == 1;
  }

  // Waits for the end. The exit code, or minus the signal that ended it. A program that takes
  // longer than `limit` is killed.
  int Wait(std::chrono::milliseconds limit = std::chrono::seconds(60)) {
    if (!Ends(limit)) {
      ADD_FAILURE() << "still running after " << limit.count() << " ms: " << error();
      ::kill(pid_, SIGKILL);
    }
    if (!ended_) {
      EXPECT_EQ(::waitpid(pid_, &status_, 0), pid_);
      ended_ = true;
    }
    return WIFEXITED(status_) ? WEXITSTATUS(status_) : -WTERMSIG(status_);
  }

  int End(int signal) {
    ::kill(pid_, signal);
    return Wait();
  }

  // Stands still until it goes on.
  void Hold() { ::kill(pid_, SIGSTOP); }
  void GoOn() { ::kill(pid_, SIGCONT); }

  // What it wrote so far.
  std::string out() const { return Content("out"); }
  std::string error() const { return Content("error"); }

 private:
  std::string Content(const char* name) const {
    std::ifstream file(files_.path() / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  TemporaryDirectory files_;
  pid_t pid_ = -1;
  int pidfd_ = -1;
  bool ended_ = false;
  int status_ = 0;
};

// What a program that ended left behind.
struct Ended {
  int exit_code = -1;
  std::string out;
  std::string error;
  std::chrono::milliseconds duration{0};
};

inline Ended RunProgram(const std::vector<std::string>& words) {
  const auto begin = std::chrono::steady_clock::now();
  Program program(words);
  Ended ended;
  ended.exit_code = program.Wait();
  ended.duration = std::chrono::duration_cast<std::chrono::milliseconds>(
      std::chrono::steady_clock::now() - begin);
  ended.out = program.out();
  ended.error = program.error();
  return ended;
}

}  // namespace loci
