// SPDX-License-Identifier: Apache-2.0
#include "server/http/http_server.h"

#include <chrono>
#include <cstdint>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/support/raw_client.h"

namespace loci {
namespace {

using ::testing::ContainsRegex;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

constexpr const char* kGet = "GET /hello HTTP/1.1\r\nHost: x\r\n\r\n";

// Says what it is given, on demand.
class ScriptedEvents final : public HttpEventSource {
 public:
  explicit ScriptedEvents(std::shared_ptr<std::vector<std::string>> script)
      : script_(std::move(script)) {}
  std::string Take() override {
    if (script_->empty()) {
      return "";
    }
    std::string next = script_->front();
    script_->erase(script_->begin());
    return next;
  }

 private:
  std::shared_ptr<std::vector<std::string>> script_;
};

class HttpServerTest : public ::testing::Test {
 protected:
  void Start(const HttpServerOptions& options = HttpServerOptions()) {
    StatusOr<std::unique_ptr<HttpServer>> server = HttpServer::Start(
        options, [this](const HttpRequest& request) { return Answer(request); }, metrics_);
    ASSERT_TRUE(server.ok()) << server.status().ToString();
    server_ = std::move(server).value();
  }

  HttpAnswer Answer(const HttpRequest& request) {
    const std::string name = request.path.empty() ? "" : request.path[0];
    if (name == "hello") {
      HttpResponse response = TextResponse(200, "hello");
      response.etag = "\"e1\"";
      return response;
    }
    if (name == "large") {
      return TextResponse(200, std::string(std::size_t{32} << 20U, 'x'));
    }
    if (name == "work") {
      return HttpWork([this] {
        work_begun_.set_value();
        work_may_end_.get_future().wait();
        return TextResponse(200, "worked");
      });
    }
    if (name == "events") {
      return HttpEventsStart(
          [this](std::function<void()> wake) -> StatusOr<std::unique_ptr<HttpEventSource>> {
            wake();
            return std::unique_ptr<HttpEventSource>(std::make_unique<ScriptedEvents>(script_));
          });
    }
    return ErrorResponse(NotFoundError("nothing here"));
  }

  std::string AnswerTo(const std::string& request) {
    RawClient client(server_->port());
    client.Send(request);
    return client.ReadAnswer();
  }

  // False if it did not come to that within 10 s.
  bool WaitForMetric(const std::string& line) const {
    const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    while (metrics_.Text().find(line) == std::string::npos) {
      if (std::chrono::steady_clock::now() > give_up) {
        return false;
      }
      std::this_thread::yield();
    }
    return true;
  }

  std::promise<void> work_begun_;
  std::promise<void> work_may_end_;
  std::shared_ptr<std::vector<std::string>> script_ = std::make_shared<std::vector<std::string>>();
  MetricRegistry metrics_;
  std::unique_ptr<HttpServer> server_;  // last: it ends before what it uses
};

TEST_F(HttpServerTest, AnswersSeveralRequestsOnOneConnectionAlsoPipelined) {
  Start();
  RawClient client(server_->port());
  client.Send(std::string(kGet) + kGet);
  for (int i = 0; i < 2; ++i) {
    const std::string answer = client.ReadAnswer();
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 200 OK\r\n"));
    EXPECT_THAT(answer, EndsWith("\r\n\r\nhello"));
  }
  client.Send(kGet);
  EXPECT_THAT(client.ReadAnswer(), EndsWith("hello"));
}

TEST_F(HttpServerTest, HeadSaysTheLengthAndSendsNoBody) {
  Start();
  RawClient client(server_->port());
  client.Send("HEAD /hello HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  const std::string answer = client.ReadToEnd();
  EXPECT_THAT(answer, HasSubstr("Content-Length: 5\r\n"));
  EXPECT_THAT(answer, EndsWith("\r\n\r\n"));
}

TEST_F(HttpServerTest, WhatTheClientHasAlreadyIsNotSentAgain) {
  Start();
  const std::string answer =
      AnswerTo("GET /hello HTTP/1.1\r\nHost: x\r\nIf-None-Match: \"e1\"\r\n\r\n");
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 304 Not Modified\r\n"));
  EXPECT_THAT(answer, HasSubstr("ETag: \"e1\"\r\n"));
  EXPECT_THAT(answer, Not(HasSubstr("hello")));
}

TEST_F(HttpServerTest, RefusesOtherMethodsBodiesAndWhatIsNoHttp) {
  Start();
  EXPECT_THAT(AnswerTo("POST /hello HTTP/1.1\r\nHost: x\r\nContent-Length: 3\r\n\r\nabc"),
              AllOf(StartsWith("HTTP/1.1 405 "), HasSubstr("Allow: GET, HEAD\r\n")));
  EXPECT_THAT(AnswerTo("GET /hello HTTP/1.1\r\nHost: x\r\nContent-Length: 3\r\n\r\nabc"),
              StartsWith("HTTP/1.1 413 "));
  EXPECT_THAT(AnswerTo("\x16\x03\x01 this is no HTTP at all\r\n\r\n"), StartsWith("HTTP/1.1 400 "));
  EXPECT_THAT(AnswerTo("GET /a/../b HTTP/1.1\r\nHost: x\r\n\r\n"), StartsWith("HTTP/1.1 400 "));
  EXPECT_THAT(AnswerTo(kGet), StartsWith("HTTP/1.1 200 "));
}

TEST_F(HttpServerTest, RefusesHeadersBeyondTheLimitHoweverTheyComeAndServesOn) {
  Start();
  const std::string many(20'000, 'a');
  EXPECT_THAT(AnswerTo("GET /hello HTTP/1.1\r\nHost: x\r\nCookie: " + many + "\r\n\r\n"),
              StartsWith("HTTP/1.1 431 "));
  EXPECT_THAT(AnswerTo("GET /" + many + " HTTP/1.1\r\nHost: x\r\n\r\n"),
              ContainsRegex("^HTTP/1.1 4(00|31) "));
  EXPECT_THAT(AnswerTo(kGet), StartsWith("HTTP/1.1 200 "));
}

TEST_F(HttpServerTest, CutsAClientThatDripsItsRequestAndServesOthersMeanwhile) {
  HttpServerOptions options;
  options.request_timeout = std::chrono::milliseconds(300);
  Start(options);
  std::vector<std::unique_ptr<RawClient>> slow;
  for (int i = 0; i < 50; ++i) {
    slow.push_back(std::make_unique<RawClient>(server_->port()));
    slow.back()->Send("GET /hello HTTP/1.1\r\nX-Slow: ");
  }
  EXPECT_THAT(AnswerTo(kGet), StartsWith("HTTP/1.1 200 "));
  for (const std::unique_ptr<RawClient>& client : slow) {
    EXPECT_THAT(client->ReadToEnd(), IsEmpty());  // closed: without the cut it would wait 10 s
  }
  EXPECT_TRUE(WaitForMetric("loci_http_connections_cut_total 50\n"));
}

TEST_F(HttpServerTest, CutsAClientThatSaysNothing) {
  HttpServerOptions options;
  options.request_timeout = std::chrono::milliseconds(200);
  options.idle_timeout = std::chrono::milliseconds(200);
  Start(options);
  RawClient silent(server_->port());
  EXPECT_THAT(silent.ReadToEnd(), IsEmpty());
  RawClient idle(server_->port());
  idle.Send(kGet);
  EXPECT_THAT(idle.ReadToEnd(), EndsWith("hello"));
}

TEST_F(HttpServerTest, CutsAClientThatDoesNotReadItsAnswer) {
  HttpServerOptions options;
  options.response_timeout = std::chrono::milliseconds(100);
  Start(options);
  RawClient deaf(server_->port());
  deaf.Send("GET /large HTTP/1.1\r\nHost: x\r\n\r\n");
  EXPECT_THAT(AnswerTo(kGet), StartsWith("HTTP/1.1 200 "));
  EXPECT_TRUE(WaitForMetric("loci_http_connections_cut_total 1\n"));
  EXPECT_LT(deaf.ReadToEnd().size(), std::size_t{32} << 20U);
}

TEST_F(HttpServerTest, OneClientTooManyIsToldSo) {
  HttpServerOptions options;
  options.connection_count_max = 2;
  Start(options);
  RawClient first(server_->port());
  RawClient second(server_->port());
  first.Send(kGet);
  second.Send(kGet);
  EXPECT_THAT(first.ReadAnswer(), StartsWith("HTTP/1.1 200 "));
  EXPECT_THAT(second.ReadAnswer(), StartsWith("HTTP/1.1 200 "));
  RawClient third(server_->port());
  EXPECT_THAT(third.ReadToEnd(), StartsWith("HTTP/1.1 503 "));
  first.Send(kGet);
  EXPECT_THAT(first.ReadAnswer(), StartsWith("HTTP/1.1 200 "));
}

TEST_F(HttpServerTest, LongWorkHoldsUpNobodyElseAndTooMuchOfItIsRefused) {
  HttpServerOptions options;
  options.worker_count = 1;
  options.work_count_max = 1;
  Start(options);
  RawClient worker(server_->port());
  worker.Send("GET /work HTTP/1.1\r\nHost: x\r\n\r\n");
  work_begun_.get_future().wait();
  EXPECT_THAT(AnswerTo(kGet), StartsWith("HTTP/1.1 200 "));
  EXPECT_THAT(AnswerTo("GET /work HTTP/1.1\r\nHost: x\r\n\r\n"),
              AllOf(StartsWith("HTTP/1.1 503 "), HasSubstr("Retry-After: 1\r\n")));
  work_may_end_.set_value();
  EXPECT_THAT(worker.ReadAnswer(), EndsWith("worked"));
}

TEST_F(HttpServerTest, StreamsEventsAndFindsOutThatAViewerIsGone) {
  HttpServerOptions options;
  options.event_interval = std::chrono::milliseconds(1);
  options.event_keepalive = std::chrono::milliseconds(20);
  Start(options);
  *script_ = {"data: one\n\n"};
  {
    RawClient viewer(server_->port());
    viewer.Send("GET /events HTTP/1.1\r\nHost: x\r\n\r\n");
    EXPECT_THAT(viewer.ReadUntil("\r\n\r\n"), HasSubstr("Content-Type: text/event-stream\r\n"));
    EXPECT_EQ(viewer.ReadUntil("\n\n"), "data: one\n\n");
    EXPECT_EQ(viewer.ReadUntil("\n\n"), ": still here\n\n");
  }
  EXPECT_TRUE(WaitForMetric("loci_http_event_streams 0\n"));
}

TEST_F(HttpServerTest, OneEventStreamTooManyIsRefused) {
  HttpServerOptions options;
  options.event_stream_count_max = 1;
  Start(options);
  RawClient viewer(server_->port());
  viewer.Send("GET /events HTTP/1.1\r\nHost: x\r\n\r\n");
  viewer.ReadUntil("\r\n\r\n");
  EXPECT_THAT(AnswerTo("GET /events HTTP/1.1\r\nHost: x\r\n\r\n"), StartsWith("HTTP/1.1 503 "));
}

TEST_F(HttpServerTest, RandomBytesNeverEndTheServer) {
  Start();
  RandomSequence random(20261122);
  for (int round = 0; round < 100; ++round) {
    RawClient client(server_->port());
    std::string bytes = round % 2 == 0 ? "" : "GET /hello HTTP/1.1\r\n";
    const std::uint64_t size = random.NextBits() % 2000;
    for (std::uint64_t i = 0; i < size; ++i) {
      bytes += static_cast<char>(random.NextBits());
    }
    client.Send(bytes);
  }
  EXPECT_THAT(AnswerTo(kGet), StartsWith("HTTP/1.1 200 "));
}

TEST_F(HttpServerTest, StopsAtOnceWhateverItsClientsDo) {
  Start();
  RawClient half(server_->port());
  half.Send("GET /hel");
  RawClient viewer(server_->port());
  viewer.Send("GET /events HTTP/1.1\r\nHost: x\r\n\r\n");
  viewer.ReadUntil("\r\n\r\n");
  const auto begin = std::chrono::steady_clock::now();
  server_->Stop();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(2));
  viewer.ReadToEnd();
  server_->Stop();  // twice is no harm
}

TEST_F(HttpServerTest, SaysWhenItsAddressIsTaken) {
  Start();
  HttpServerOptions options;
  options.endpoint.port = server_->port();
  const StatusOr<std::unique_ptr<HttpServer>> second = HttpServer::Start(
      options, [](const HttpRequest&) { return TextResponse(200, ""); }, metrics_);
  ASSERT_FALSE(second.ok());
  EXPECT_EQ(second.status().code(), StatusCode::kUnavailable);
  EXPECT_THAT(second.status().message(), HasSubstr(std::to_string(server_->port())));
}

TEST(HttpEndpointTest, ReadsAddressAndPortAndKnowsLoopback) {
  const StatusOr<HttpEndpoint> local = ParseHttpEndpoint("127.0.0.1:5680");
  ASSERT_TRUE(local.ok());
  EXPECT_EQ(local->port, 5680);
  EXPECT_TRUE(local->loopback);
  EXPECT_TRUE(ParseHttpEndpoint("[::1]:1")->loopback);
  EXPECT_FALSE(ParseHttpEndpoint("0.0.0.0:1")->loopback);
  for (const char* bad :
       {"", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "localhost:1", "x:-1"}) {
    EXPECT_EQ(ParseHttpEndpoint(bad).status().code(), StatusCode::kInvalidArgument) << bad;
  }
}

}  // namespace
}  // namespace loci
