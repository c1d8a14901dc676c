// SPDX-License-Identifier: Apache-2.0
// Tests of the programs as a user runs them: locid on a directory, and loci as its client.
#pragma once

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "clients/cpp/channel.h"
#include "loci/v1/mapping.pb.h"
#include "tests/support/office_log.h"
#include "tests/support/program.h"
#include "tests/support/raw_client.h"
#include "tests/support/server_process.h"
#include "tests/support/temporary_directory.h"

namespace loci {

// What a map is in the end.
struct Outcome {
  std::string digest;
  std::string trajectory;  // the exported file
};

// An answer over HTTP; status 0 if there was none.
struct HttpReply {
  int status = 0;
  std::string body;
};

inline HttpReply HttpGet(std::uint16_t port, const std::string& target) {
  RawClient client(port);
  HttpReply reply;
  client.Send("GET " + target + " HTTP/1.1\r\nHost: loci\r\nConnection: close\r\n\r\n");
  const std::string answer = client.ReadToEnd();
  if (answer.starts_with("HTTP/1.1 ")) {
    reply.status = std::stoi(answer.substr(9, 3));
    reply.body = answer.substr(answer.find("\r\n\r\n") + 4);
  }
  return reply;
}

class ProgramsTest : public testing::Test {
 protected:
  using Words = std::vector<std::string>;

  std::filesystem::path Path(const std::string& name) const { return directory_.path() / name; }

  // On the maps of the test, or elsewhere; on the port it had before.
  void StartServer() { StartServerOn(Path("maps")); }
  void StartServerOn(const std::filesystem::path& data) {
    server_.reset();
    server_ = std::make_unique<ServerProcess>(
        LOCI_LOCID, data, endpoint_.empty() ? "tcp://127.0.0.1:0" : endpoint_);
    endpoint_ = server_->endpoint();
    if (channel_ == nullptr) {
      channel_ = client::Channel::Create(endpoint_);
    }
  }
  ServerProcess& server() { return *server_; }
  client::Channel& channel() { return *channel_; }
  const std::string& endpoint() const { return endpoint_; }

  // The words of a command, with the server that it talks to.
  Words Command(Words words) const {
    words.insert(words.begin(), LOCI_CLI);
    words.insert(words.end(), {"--server", endpoint_});
    return words;
  }
  Ended Loci(const Words& words) const { return RunProgram(Command(words)); }
  // Of a command that must succeed.
  nlohmann::json LociJson(Words words) const {
    words.emplace_back("--json");
    const Ended ended = Loci(words);
    EXPECT_EQ(ended.exit_code, 0) << ended.error;
    const nlohmann::json json = nlohmann::json::parse(ended.out, nullptr, false);
    EXPECT_FALSE(json.is_discarded()) << ended.out;
    return json;
  }
  nlohmann::json Stream(const std::string& log, const std::string& map, Words more = {}) const {
    Words words = {"stream", log, "--map", map, "--session", "run"};
    words.insert(words.end(), more.begin(), more.end());
    return LociJson(words);
  }

  Outcome OutcomeOf(const std::string& map) const {
    const std::string file = Path(map + ".tum").string();
    EXPECT_EQ(Loci({"export", "trajectory", "--map", map, "--out", file}).exit_code, 0);
    return {LociJson({"map", "info", map}).value("state_digest", ""), FileContent(file)};
  }

  // The server's word on the session `run`; empty while it cannot be reached.
  v1::SessionState SessionOf(const std::string& map) {
    v1::GetSessionRequest request;
    request.set_map(map);
    request.set_session("run");
    auto state = channel_->Call<v1::SessionState>("loci.v1.Mapping/GetSession", request);
    return state.ok() ? std::move(state).value() : v1::SessionState();
  }

  // Asks again and again; false if the answer is still no after `limit`.
  template <typename Condition>
  static bool Becomes(Condition condition,
                      std::chrono::milliseconds limit = std::chrono::seconds(30)) {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (!condition()) {
      if (std::chrono::steady_clock::now() >= end) {
        return false;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return true;
  }

  static std::string FileContent(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

 private:
  const TemporaryDirectory directory_;
  std::unique_ptr<ServerProcess> server_;
  std::string endpoint_;
  std::shared_ptr<client::Channel> channel_;
};

}  // namespace loci
