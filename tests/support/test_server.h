// SPDX-License-Identifier: Apache-2.0
// A whole server on a temporary disk and free ports, and a client of it.
#pragma once

#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "clients/cpp/channel.h"
#include "loci/v1/map_admin.pb.h"
#include "loci/v1/mapping.pb.h"
#include "server/server.h"
#include "tests/support/temporary_directory.h"

namespace loci {

class TestServer {
 public:
  TestServer() {
    options_.data = disk_.path() / "maps";
    options_.listen = "tcp://127.0.0.1:0";
    options_.http = "127.0.0.1:0";
    options_.version = "test";
    Start();
  }

  void Start() {
    auto server = Server::Start(options_);
    ASSERT_TRUE(server.ok()) << server.status().ToString();
    server_ = std::move(server).value();
    channel_ = client::Channel::Create(server_->rpc_endpoint());
  }
  void Stop() {
    channel_.reset();
    server_.reset();
  }

  client::Channel& channel() { return *channel_; }
  std::shared_ptr<client::Channel> shared_channel() { return channel_; }
  const Server& server() const { return *server_; }
  ServerOptions& options() { return options_; }

  template <typename Response>
  StatusOr<Response> Call(const std::string& method, const google::protobuf::MessageLite& request) {
    return channel_->Call<Response>("loci.v1." + method, request);
  }

  Status CreateMap(const std::string& map) {
    v1::CreateMapRequest request;
    request.set_map(map);
    return Call<v1::CreateMapResponse>("MapAdmin/CreateMap", request).status();
  }
  StatusOr<v1::SessionState> OpenSession(const std::string& map, const std::string& session) {
    v1::OpenSessionRequest request;
    request.set_map(map);
    request.set_session(session);
    request.set_robot("robot");
    return Call<v1::SessionState>("Mapping/OpenSession", request);
  }
  StatusOr<v1::MapInfo> Info(const std::string& map) {
    v1::GetMapInfoRequest request;
    request.set_map(map);
    return Call<v1::MapInfo>("MapAdmin/GetMapInfo", request);
  }

 private:
  TemporaryDirectory disk_;
  ServerOptions options_;
  std::unique_ptr<Server> server_;
  std::shared_ptr<client::Channel> channel_;
};

}  // namespace loci
