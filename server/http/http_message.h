// SPDX-License-Identifier: Apache-2.0
// What an HTTP request asks and what its answer says, without sockets.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "core/base/status.h"

namespace loci {

// A GET or HEAD request. Path and query are percent-decoded; a decoded slash stays in its segment.
struct HttpRequest {
  std::vector<std::string> path;             // "/maps/hall" is {"maps", "hall"}; "/" is empty
  std::map<std::string, std::string> query;  // each key once
};

// Reads "/maps/hall/tiles?revision=7".
// Errors: kInvalidArgument for a target that does not start with a slash, malformed %-escapes,
// control characters, segments "." and "..", and a query key that stands twice.
StatusOr<HttpRequest> ParseHttpTarget(std::string_view target);

struct HttpResponse {
  unsigned status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  std::shared_ptr<const std::string> body;  // null: empty
  // Quoted, of the content; the server answers 304 when the client has it already.
  std::string etag;
  // Further header lines. Values come from us and never from a request.
  std::vector<std::pair<std::string, std::string>> headers;
};

HttpResponse TextResponse(unsigned status, std::string text);
// The HTTP status that fits the code, and the message as text: whoever asked wrongly learns why.
HttpResponse ErrorResponse(const Status& status);

// True if `etag` stands in the value of If-None-Match (RFC 9110, section 13.1.2; weak comparison).
bool EtagMatches(std::string_view if_none_match, std::string_view etag);

// The news for one viewer, as server-sent events.
class HttpEventSource {
 public:
  HttpEventSource() = default;
  HttpEventSource(const HttpEventSource&) = delete;
  HttpEventSource& operator=(const HttpEventSource&) = delete;
  virtual ~HttpEventSource() = default;

  // All that happened since the last call, merged into one event block; empty if nothing did.
  // Called by one thread; must not wait.
  virtual std::string Take() = 0;
};

// Work that may take milliseconds: it runs on a worker, not on the thread that serves sockets.
using HttpWork = std::function<HttpResponse()>;
// Begins a stream of events. `wake` says that Take() has something; any thread may call it, as long
// as the source lives.
using HttpEventsStart =
    std::function<StatusOr<std::unique_ptr<HttpEventSource>>(std::function<void()> wake)>;
using HttpAnswer = std::variant<HttpResponse, HttpWork, HttpEventsStart>;
// Decides what a request is answered with, at once: it runs on the thread that serves sockets.
using HttpHandler = std::function<HttpAnswer(const HttpRequest&)>;

}  // namespace loci
