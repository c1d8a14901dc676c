// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/json_output.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>

#include <google/protobuf/descriptor.h>

namespace loci::cli {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

void JsonWriter::Separate() {
  if (needs_comma_) {
    text_ += ',';
  }
  needs_comma_ = true;
}

JsonWriter& JsonWriter::Raw(std::string_view text) {
  Separate();
  text_ += text;
  return *this;
}

JsonWriter& JsonWriter::BeginObject() {
  Raw("{");
  needs_comma_ = false;
  return *this;
}

JsonWriter& JsonWriter::EndObject() {
  text_ += '}';
  needs_comma_ = true;
  return *this;
}

JsonWriter& JsonWriter::BeginArray() {
  Raw("[");
  needs_comma_ = false;
  return *this;
}

JsonWriter& JsonWriter::EndArray() {
  text_ += ']';
  needs_comma_ = true;
  return *this;
}

JsonWriter& JsonWriter::Key(std::string_view key) {
  Value(key);
  text_ += ':';
  needs_comma_ = false;
  return *this;
}

JsonWriter& JsonWriter::Value(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (static_cast<unsigned char>(c) < 0x20U) {
      std::array<char, 8> escape = {};
      std::snprintf(escape.data(), escape.size(), "\\u%04x", static_cast<unsigned>(c));
      quoted += escape.data();
    } else {
      quoted += c;
    }
  }
  return Raw(quoted + '"');
}

JsonWriter& JsonWriter::Value(bool value) {
  return Raw(value ? "true" : "false");
}

JsonWriter& JsonWriter::Value(double value) {
  if (!std::isfinite(value)) {
    return Raw("null");
  }
  std::array<char, 40> buffer = {};
  const auto result = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return Raw(std::string_view(buffer.data(), static_cast<std::size_t>(result.ptr - buffer.data())));
}

JsonWriter& JsonWriter::Value(std::int64_t value) {
  return Raw(std::to_string(value));
}
JsonWriter& JsonWriter::Value(std::uint64_t value) {
  return Raw(std::to_string(value));
}

JsonWriter& JsonWriter::Value(const Message& message) {
  BeginObject();
  Fields(message);
  return EndObject();
}

JsonWriter& JsonWriter::Fields(const Message& message) {
  const Reflection& reflection = *message.GetReflection();
  for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
    const FieldDescriptor& field = *message.GetDescriptor()->field(i);
    if (!field.is_repeated() && field.has_presence() && !reflection.HasField(message, &field)) {
      continue;
    }
    Key(field.name());
    if (!field.is_repeated()) {
      Field(message, field, -1);
      continue;
    }
    BeginArray();
    for (int index = 0; index < reflection.FieldSize(message, &field); ++index) {
      Field(message, field, index);
    }
    EndArray();
  }
  return *this;
}

// `index` -1: the field is not repeated.
void JsonWriter::Field(const Message& message, const FieldDescriptor& field, int index) {
  const Reflection& reflection = *message.GetReflection();
  const bool one = index < 0;
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_INT32:
      Value(std::int64_t{one ? reflection.GetInt32(message, &field)
                             : reflection.GetRepeatedInt32(message, &field, index)});
      break;
    case FieldDescriptor::CPPTYPE_UINT32:
      Value(std::uint64_t{one ? reflection.GetUInt32(message, &field)
                              : reflection.GetRepeatedUInt32(message, &field, index)});
      break;
    case FieldDescriptor::CPPTYPE_INT64:
      Value(std::int64_t{one ? reflection.GetInt64(message, &field)
                             : reflection.GetRepeatedInt64(message, &field, index)});
      break;
    case FieldDescriptor::CPPTYPE_UINT64:
      Value(std::uint64_t{one ? reflection.GetUInt64(message, &field)
                              : reflection.GetRepeatedUInt64(message, &field, index)});
      break;
    case FieldDescriptor::CPPTYPE_DOUBLE:
      Value(one ? reflection.GetDouble(message, &field)
                : reflection.GetRepeatedDouble(message, &field, index));
      break;
    case FieldDescriptor::CPPTYPE_FLOAT:
      Value(static_cast<double>(one ? reflection.GetFloat(message, &field)
                                    : reflection.GetRepeatedFloat(message, &field, index)));
      break;
    case FieldDescriptor::CPPTYPE_BOOL:
      Value(one ? reflection.GetBool(message, &field)
                : reflection.GetRepeatedBool(message, &field, index));
      break;
    case FieldDescriptor::CPPTYPE_ENUM:
      Value(std::string_view((one ? reflection.GetEnum(message, &field)
                                  : reflection.GetRepeatedEnum(message, &field, index))
                                 ->name()));
      break;
    case FieldDescriptor::CPPTYPE_STRING:
      Value(std::string_view(one ? reflection.GetString(message, &field)
                                 : reflection.GetRepeatedString(message, &field, index)));
      break;
    case FieldDescriptor::CPPTYPE_MESSAGE:
      Value(one ? reflection.GetMessage(message, &field)
                : reflection.GetRepeatedMessage(message, &field, index));
      break;
  }
}

}  // namespace loci::cli
