// SPDX-License-Identifier: Apache-2.0
// locid as a process of its own, to be killed.
#pragma once

#include <array>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

namespace loci {

class ServerProcess {
 public:
  // `listen` with port 0 takes a free one. `more` are options besides.
  ServerProcess(const std::string& program,
                const std::filesystem::path& data,
                const std::string& listen = "tcp://127.0.0.1:0",
                const std::vector<std::string>& more = {}) {
    std::vector<std::string> words = {
        program, "--data", data.string(), "--listen", listen, "--http", "127.0.0.1:0"};
    words.insert(words.end(), more.begin(), more.end());
    std::vector<char*> arguments;
    for (std::string& word : words) {
      arguments.push_back(word.data());
    }
    arguments.push_back(nullptr);
    std::array<int, 2> out{};
    EXPECT_EQ(::pipe(out.data()), 0);
    pid_ = ::fork();
    if (pid_ == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // it does not outlive a test that crashes
      ::dup2(out[1], STDOUT_FILENO);
      ::close(out[0]);
      ::execv(program.c_str(), arguments.data());
      ::_exit(127);
    }
    ::close(out[1]);
    std::string line;
    for (char c = 0; ::read(out[0], &c, 1) == 1 && c != '\n';) {
      line += c;
    }
    ::close(out[0]);
    constexpr const char* kBefore = "listening rpc=";
    EXPECT_EQ(line.rfind(kBefore, 0), 0U) << line;
    endpoint_ = line.substr(std::string(kBefore).size());
    endpoint_ = endpoint_.substr(0, endpoint_.find(' '));
    http_port_ = PortOf(line);
    rpc_port_ = PortOf(endpoint_);
  }
  ServerProcess(const ServerProcess&) = delete;
  ServerProcess& operator=(const ServerProcess&) = delete;
  ~ServerProcess() {
    if (pid_ > 0) {
      End(SIGKILL);
    }
  }

  const std::string& endpoint() const { return endpoint_; }
  std::uint16_t rpc_port() const { return rpc_port_; }
  std::uint16_t http_port() const { return http_port_; }
  pid_t pid() const { return pid_; }

  // Sends the signal and waits for the end. The exit code, or minus the signal that ended it.
  int End(int signal) {
    ::kill(pid_, signal);
    int status = 0;
    EXPECT_EQ(::waitpid(pid_, &status, 0), pid_);
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

 private:
  // What stands behind the last colon.
  static std::uint16_t PortOf(const std::string& text) {
    return static_cast<std::uint16_t>(std::stoul(text.substr(text.rfind(':') + 1)));
  }

  pid_t pid_ = -1;
  std::string endpoint_;
  std::uint16_t rpc_port_ = 0;
  std::uint16_t http_port_ = 0;
};

}  // namespace loci
