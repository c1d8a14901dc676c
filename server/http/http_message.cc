// SPDX-License-Identifier: Apache-2.0
#include "server/http/http_message.h"

#include <charconv>
#include <cstddef>
#include <optional>

namespace loci {
namespace {

// Nothing if an escape is malformed or a control character (also an escaped one) stands in it.
std::optional<std::string> PercentDecoded(std::string_view text) {
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '%') {
      unsigned value = 0;
      const char* const digits = text.data() + i + 1;
      if (text.size() - i < 3) {
        return std::nullopt;
      }
      const std::from_chars_result end = std::from_chars(digits, digits + 2, value, 16);
      if (end.ptr != digits + 2) {
        return std::nullopt;
      }
      c = static_cast<char>(value);
      i += 2;
    }
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      return std::nullopt;
    }
    decoded += c;
  }
  return decoded;
}

// Cuts the piece before `separator` (all, if there is none) off the front of `rest`.
std::string_view TakeUntil(char separator, std::string_view& rest) {
  const std::size_t end = rest.find(separator);
  const std::string_view piece = rest.substr(0, end);
  rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
  return piece;
}

Status ParsePath(std::string_view rest, HttpRequest& request) {
  while (!rest.empty()) {
    const std::string_view piece = TakeUntil('/', rest);
    std::optional<std::string> segment = PercentDecoded(piece);
    if (!segment) {
      return InvalidArgumentError("path: malformed escape or control character");
    }
    if (*segment == "." || *segment == "..") {
      return InvalidArgumentError("path: segment \"" + *segment + "\", must be a name");
    }
    request.path.push_back(*std::move(segment));
  }
  return Status();
}

Status ParseQuery(std::string_view rest, HttpRequest& request) {
  while (!rest.empty()) {
    std::string_view value_text = TakeUntil('&', rest);
    std::optional<std::string> key = PercentDecoded(TakeUntil('=', value_text));
    std::optional<std::string> value = PercentDecoded(value_text);
    if (!key || !value) {
      return InvalidArgumentError("query: malformed escape or control character");
    }
    if (!request.query.emplace(*key, *std::move(value)).second) {
      return InvalidArgumentError("query: \"" + *key + "\" stands twice, must stand once");
    }
  }
  return Status();
}

unsigned HttpStatusOf(StatusCode code) {
  switch (code) {
    case StatusCode::kOk:
      return 200;
    case StatusCode::kInvalidArgument:
    case StatusCode::kOutOfRange:
      return 400;
    case StatusCode::kUnauthenticated:
      return 401;
    case StatusCode::kPermissionDenied:
      return 403;
    case StatusCode::kNotFound:
      return 404;
    case StatusCode::kAlreadyExists:
    case StatusCode::kFailedPrecondition:
    case StatusCode::kAborted:
      return 409;
    case StatusCode::kUnimplemented:
      return 501;
    case StatusCode::kResourceExhausted:
    case StatusCode::kUnavailable:
      return 503;
    case StatusCode::kDeadlineExceeded:
      return 504;
    case StatusCode::kCancelled:
    case StatusCode::kUnknown:
    case StatusCode::kInternal:
    case StatusCode::kDataLoss:
      return 500;
  }
  return 500;
}

}  // namespace

StatusOr<HttpRequest> ParseHttpTarget(std::string_view target) {
  if (target.empty() || target.front() != '/') {
    return InvalidArgumentError("path: must start with a slash");
  }
  HttpRequest request;
  std::string_view query = target;
  const std::string_view path = TakeUntil('?', query);
  LOCI_RETURN_IF_ERROR(ParsePath(path.substr(1), request));
  LOCI_RETURN_IF_ERROR(ParseQuery(query, request));
  return request;
}

HttpResponse TextResponse(unsigned status, std::string text) {
  HttpResponse response;
  response.status = status;
  response.body = std::make_shared<const std::string>(std::move(text));
  return response;
}

HttpResponse ErrorResponse(const Status& status) {
  HttpResponse response = TextResponse(HttpStatusOf(status.code()), status.ToString() + "\n");
  if (response.status == 503) {
    response.headers.emplace_back("Retry-After", "1");
  }
  return response;
}

bool EtagMatches(std::string_view if_none_match, std::string_view etag) {
  std::string_view rest = if_none_match;
  while (!rest.empty()) {
    std::string_view candidate = TakeUntil(',', rest);
    while (!candidate.empty() && candidate.front() == ' ') {
      candidate.remove_prefix(1);
    }
    while (!candidate.empty() && candidate.back() == ' ') {
      candidate.remove_suffix(1);
    }
    if (candidate.substr(0, 2) == "W/") {
      candidate.remove_prefix(2);
    }
    if (candidate == "*" || candidate == etag) {
      return true;
    }
  }
  return false;
}

}  // namespace loci
