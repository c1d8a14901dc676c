// SPDX-License-Identifier: Apache-2.0
// Results as JSON.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include <google/protobuf/message.h>

namespace loci::cli {

// Writes JSON as it is told, with commas where they belong.
//
//   JsonWriter json;
//   json.BeginObject().Key("ready").Value(true).EndObject();
class JsonWriter {
 public:
  JsonWriter& BeginObject();
  JsonWriter& EndObject();
  JsonWriter& BeginArray();
  JsonWriter& EndArray();
  JsonWriter& Key(std::string_view key);
  JsonWriter& Value(std::string_view text);
  JsonWriter& Value(const char* text) { return Value(std::string_view(text)); }
  JsonWriter& Value(bool value);
  JsonWriter& Value(double value);  // null if it is not finite
  JsonWriter& Value(std::int64_t value);
  JsonWriter& Value(std::uint64_t value);
  // All fields under their names in the .proto file, also those at their default. Numbers are
  // numbers, also of 64 bits (the mapping of Protocol Buffers makes texts of them).
  JsonWriter& Value(const google::protobuf::Message& message);
  // The fields of a message inside an object that is open.
  JsonWriter& Fields(const google::protobuf::Message& message);

  const std::string& text() const { return text_; }

 private:
  void Separate();
  void Field(const google::protobuf::Message& message,
             const google::protobuf::FieldDescriptor& field,
             int index);
  JsonWriter& Raw(std::string_view text);

  std::string text_;
  bool needs_comma_ = false;
};

}  // namespace loci::cli
