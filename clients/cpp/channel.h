// SPDX-License-Identifier: Apache-2.0
// Calls to a Loci server.
//
//   auto channel = loci::client::Channel::Create("tcp://127.0.0.1:5600");
//   loci::v1::GetMapInfoRequest request;
//   request.set_map("office");
//   auto info = channel->Call<loci::v1::MapInfo>("loci.v1.MapAdmin/GetMapInfo", request);
//   if (!info.ok()) std::cerr << info.status().ToString() << '\n';
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <google/protobuf/message_lite.h>

#include "clients/cpp/link.h"
#include "core/base/status.h"

namespace loci::client {

struct ChannelOptions {
  // A server that says nothing is pinged after the first and given up after the second.
  std::chrono::milliseconds ping_after{10'000};
  std::chrono::milliseconds gone_after{30'000};
  // A connection is given up when it is not there after this.
  std::chrono::milliseconds connect_max{5'000};
  // Between two attempts to connect, for calls that wait: grows from the first to the second.
  std::chrono::milliseconds backoff_min{50};
  std::chrono::milliseconds backoff_max{1'000};
  // Messages of one stream that the reader has not taken: over the first, and while nobody waits
  // for another call, the channel stops reading; over the second, the stream is cancelled.
  std::size_t stream_pause_bytes = std::size_t{16} << 20U;
  std::size_t stream_unread_max_bytes = std::size_t{256} << 20U;
  LinkFactory link_factory = MakeZmqLink;
};

struct CallOptions {
  // From now; zero: none. A unary call without one could wait for ever.
  std::chrono::microseconds timeout{30'000'000};
  // False: UNAVAILABLE as soon as the server cannot be reached. True: tries to connect until the
  // deadline. A call that was sent is never sent again: that is for the caller to decide, because
  // only he knows whether it may be done twice.
  bool wait_for_ready = false;
  std::map<std::string, std::string> metadata;
};

class StreamState;

// Stops a call. A copy stops the same one. Harmless when the call is over.
class CallHandle {
 public:
  CallHandle() = default;
  explicit CallHandle(std::function<void()> cancel) : cancel_(std::move(cancel)) {}
  // The call ends with CANCELLED, here at once and in the server soon after.
  void Cancel() const {
    if (cancel_) {
      cancel_();
    }
  }

 private:
  std::function<void()> cancel_;
};

// Reads the messages of a server stream. One thread at a time, but Cancel may come from any. Its
// destruction cancels the call.
class RawStream {
 public:
  explicit RawStream(std::shared_ptr<StreamState> state);
  RawStream(RawStream&&) noexcept;
  RawStream& operator=(RawStream&&) noexcept;
  ~RawStream();

  // The next message; nothing at the end of the stream, which status() explains.
  std::optional<std::string> Next();
  // The same, but waits no longer than `timeout`: kTimedOut leaves the stream as it is.
  enum class NextResult { kMessage, kEnd, kTimedOut };
  NextResult Next(std::string& body, std::chrono::milliseconds timeout);
  // How the call ended; meaningful after Next gave nothing.
  Status status() const;
  void Cancel();
  // Ends the call with this status, unless it has ended.
  void Abandon(const Status& status);

 private:
  std::shared_ptr<StreamState> state_;
};

// The same with messages of one type.
template <typename Response>
class StreamReader {
 public:
  explicit StreamReader(RawStream stream) : stream_(std::move(stream)) {}

  // while (stream.Next(tile)) { ... }  then look at stream.status().
  bool Next(Response& response) {
    const std::optional<std::string> body = stream_.Next();
    return body.has_value() && Parse(*body, response);
  }
  RawStream::NextResult Next(Response& response, std::chrono::milliseconds timeout) {
    std::string body;
    const RawStream::NextResult result = stream_.Next(body, timeout);
    if (result == RawStream::NextResult::kMessage && !Parse(body, response)) {
      return RawStream::NextResult::kEnd;
    }
    return result;
  }
  Status status() const { return stream_.status(); }
  void Cancel() { stream_.Cancel(); }

 private:
  bool Parse(const std::string& body, Response& response) {
    if (response.ParseFromString(body)) {
      return true;
    }
    stream_.Abandon(InternalError("the server's message is no " + response.GetTypeName()));
    return false;
  }
  RawStream stream_;
};

// A connection to one server, made when the first call needs it and made again after a loss. Any
// thread may call. All calls end with UNAVAILABLE when the connection is lost; the message names
// endpoint, method and what to do.
class Channel {
 public:
  using RawCallback = std::function<void(StatusOr<std::string> body)>;

  static std::shared_ptr<Channel> Create(std::string endpoint, ChannelOptions options = {});
  Channel(const Channel&) = delete;
  Channel& operator=(const Channel&) = delete;
  // Ends the calls in flight with CANCELLED. Not to be called from a callback.
  ~Channel();

  const std::string& endpoint() const;

  // A unary call: waits for the answer.
  template <typename Response>
  StatusOr<Response> Call(std::string_view method,
                          const google::protobuf::MessageLite& request,
                          const CallOptions& options = {}) {
    return ParseAs<Response>(method, CallRaw(method, request.SerializeAsString(), options));
  }

  // A unary call that answers by `callback`, on the channel's thread: it must be short, and must
  // not make calls that wait.
  template <typename Response>
  CallHandle CallAsync(std::string_view method,
                       const google::protobuf::MessageLite& request,
                       const CallOptions& options,
                       std::function<void(StatusOr<Response> response)> callback) {
    return CallRawAsync(
        method,
        request.SerializeAsString(),
        options,
        [method = std::string(method), callback = std::move(callback)](StatusOr<std::string> body) {
          callback(ParseAs<Response>(method, std::move(body)));
        });
  }

  // A unary call whose answer is waited for later.
  template <typename Response>
  std::future<StatusOr<Response>> CallFuture(std::string_view method,
                                             const google::protobuf::MessageLite& request,
                                             const CallOptions& options = {}) {
    auto promise = std::make_shared<std::promise<StatusOr<Response>>>();
    std::future<StatusOr<Response>> future = promise->get_future();
    CallAsync<Response>(method, request, options, [promise](StatusOr<Response> response) {
      promise->set_value(std::move(response));
    });
    return future;
  }

  // A server stream. Its deadline is none unless `options` say so.
  template <typename Response>
  StreamReader<Response> Stream(std::string_view method,
                                const google::protobuf::MessageLite& request,
                                const CallOptions& options = NoTimeout()) {
    return StreamReader<Response>(StreamRaw(method, request.SerializeAsString(), options));
  }

  // The same on bytes, for callers without generated code.
  StatusOr<std::string> CallRaw(std::string_view method,
                                std::string body,
                                const CallOptions& options = {});
  CallHandle CallRawAsync(std::string_view method,
                          std::string body,
                          const CallOptions& options,
                          RawCallback callback);
  RawStream StreamRaw(std::string_view method,
                      std::string body,
                      const CallOptions& options = NoTimeout());

  static CallOptions NoTimeout() {
    CallOptions options;
    options.timeout = std::chrono::microseconds(0);
    return options;
  }

 private:
  class Impl;
  explicit Channel(std::shared_ptr<Impl> impl);

  template <typename Response>
  static StatusOr<Response> ParseAs(std::string_view method, StatusOr<std::string> body) {
    if (!body.ok()) {
      return body.status();
    }
    Response response;
    if (!response.ParseFromString(*body)) {
      return InternalError(std::string(method) + ": the server's answer is no " +
                           response.GetTypeName());
    }
    return response;
  }

  std::shared_ptr<Impl> impl_;
};

}  // namespace loci::client
