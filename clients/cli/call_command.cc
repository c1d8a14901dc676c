// SPDX-License-Identifier: Apache-2.0
// `loci call`: any method of a server, by its reflection and JSON.
#include "clients/cli/call_command.h"

#include <memory>
#include <optional>
#include <ostream>
#include <utility>
#include <vector>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/dynamic_message.h>
#include <google/protobuf/util/json_util.h>

#include "loci/v1/reflection.pb.h"

namespace loci::cli {
namespace {

using google::protobuf::DescriptorPool;
using google::protobuf::DynamicMessageFactory;
using google::protobuf::Message;
using google::protobuf::MethodDescriptor;
using google::protobuf::ServiceDescriptor;

// What a server says of itself.
struct Description {
  DescriptorPool pool;
  std::vector<const ServiceDescriptor*> services;
};

StatusOr<std::unique_ptr<Description>> Describe(client::Channel& channel,
                                                const client::CallOptions& options) {
  LOCI_ASSIGN_OR_RETURN(
      const v1::GetDescriptorsResponse response,
      channel.Call<v1::GetDescriptorsResponse>(
          "loci.v1.Reflection/GetDescriptors", v1::GetDescriptorsRequest(), options));
  auto description = std::make_unique<Description>();
  for (const auto& file : response.files().file()) {
    if (description->pool.BuildFile(file) == nullptr) {
      return InternalError("the server's description of " + file.name() + " is not consistent");
    }
  }
  for (const std::string& name : response.services()) {
    const ServiceDescriptor* service = description->pool.FindServiceByName(name);
    if (service == nullptr) {
      return InternalError("the server does not describe its service " + name);
    }
    description->services.push_back(service);
  }
  return description;
}

void List(const Description& description, const std::string& only_service, std::ostream& out) {
  for (const ServiceDescriptor* service : description.services) {
    if (!only_service.empty() && service->full_name() != only_service) {
      continue;
    }
    for (int i = 0; i < service->method_count(); ++i) {
      const MethodDescriptor& method = *service->method(i);
      out << service->full_name() << '/' << method.name() << '(' << method.input_type()->full_name()
          << ") returns (" << (method.server_streaming() ? "stream " : "")
          << method.output_type()->full_name() << ")\n";
    }
  }
}

bool HasService(const Description& description, const std::string& name) {
  for (const ServiceDescriptor* service : description.services) {
    if (service->full_name() == name) {
      return true;
    }
  }
  return false;
}

StatusOr<const MethodDescriptor*> FindMethod(const Description& description,
                                             const std::string& name) {
  const std::size_t slash = name.find('/');
  std::string known;
  for (const ServiceDescriptor* service : description.services) {
    known += (known.empty() ? "" : ", ") + service->full_name();
    if (service->full_name() != name.substr(0, slash)) {
      continue;
    }
    const MethodDescriptor* method = service->FindMethodByName(name.substr(slash + 1));
    if (method != nullptr) {
      return method;
    }
    std::string methods;
    for (int i = 0; i < service->method_count(); ++i) {
      methods += (i == 0 ? "" : ", ") + service->method(i)->name();
    }
    return NotFoundError(name + ": the service has " + methods);
  }
  return NotFoundError(name + ": the server has the services " + known);
}

Status Print(const Message& message, bool compact, std::ostream& out) {
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = !compact;
  options.preserve_proto_field_names = true;
  options.always_print_primitive_fields = true;
  std::string json;
  const auto status = google::protobuf::util::MessageToJsonString(message, &json, options);
  if (!status.ok()) {
    return InternalError("the answer cannot be written as JSON: " + status.ToString());
  }
  out << json << (json.ends_with('\n') ? "" : "\n");
  return {};
}

// Parses one answer and prints it.
class Printer {
 public:
  Printer(DynamicMessageFactory& factory, const MethodDescriptor& method, bool compact)
      : prototype_(*factory.GetPrototype(method.output_type())), compact_(compact) {}

  Status operator()(const std::string& body, std::ostream& out) const {
    const std::unique_ptr<Message> message(prototype_.New());
    if (!message->ParseFromString(body)) {
      return InternalError("the server's answer is no " + message->GetTypeName());
    }
    return Print(*message, compact_, out);
  }

 private:
  const Message& prototype_;
  const bool compact_;
};

}  // namespace

Status RunCall(client::Channel& channel, const CallArguments& arguments, std::ostream& out) {
  LOCI_ASSIGN_OR_RETURN(const std::unique_ptr<Description> description,
                        Describe(channel, arguments.options));
  if (arguments.method.empty() || HasService(*description, arguments.method)) {
    List(*description, arguments.method, out);
    return {};
  }
  LOCI_ASSIGN_OR_RETURN(const MethodDescriptor* const method,
                        FindMethod(*description, arguments.method));
  DynamicMessageFactory factory(&description->pool);
  const std::unique_ptr<Message> request(factory.GetPrototype(method->input_type())->New());
  const auto parsed = google::protobuf::util::JsonStringToMessage(arguments.json, request.get());
  if (!parsed.ok()) {
    return InvalidArgumentError("the JSON is no " + method->input_type()->full_name() + ": " +
                                std::string(parsed.message()));
  }
  const Printer printer(factory, *method, arguments.compact);
  if (!method->server_streaming()) {
    LOCI_ASSIGN_OR_RETURN(
        const std::string body,
        channel.CallRaw(arguments.method, request->SerializeAsString(), arguments.options));
    return printer(body, out);
  }
  client::RawStream stream =
      channel.StreamRaw(arguments.method, request->SerializeAsString(), arguments.options);
  while (const std::optional<std::string> body = stream.Next()) {
    LOCI_RETURN_IF_ERROR(printer(*body, out));
    out.flush();
  }
  return stream.status();
}

}  // namespace loci::cli
