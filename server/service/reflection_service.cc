// SPDX-License-Identifier: Apache-2.0
// The server describes its services.
#include "server/service/reflection_service.h"

#include <set>
#include <string>

namespace loci {
namespace {

using google::protobuf::FileDescriptor;

void AddFile(const FileDescriptor& file,
             std::set<std::string>& added,
             google::protobuf::FileDescriptorSet& files) {
  if (!added.insert(file.name()).second) {
    return;
  }
  for (int i = 0; i < file.dependency_count(); ++i) {
    AddFile(*file.dependency(i), added, files);
  }
  file.CopyTo(files.add_file());
}

}  // namespace

v1::GetDescriptorsResponse DescribeServices(
    const std::vector<const google::protobuf::ServiceDescriptor*>& services) {
  v1::GetDescriptorsResponse response;
  std::set<std::string> added;
  for (const google::protobuf::ServiceDescriptor* service : services) {
    response.add_services(service->full_name());
    AddFile(*service->file(), added, *response.mutable_files());
  }
  return response;
}

void RegisterReflection(Dispatcher& dispatcher) {
  dispatcher.AddService("loci.v1.Reflection");
  dispatcher.AddUnary<v1::GetDescriptorsRequest, v1::GetDescriptorsResponse>(
      "loci.v1.Reflection/GetDescriptors",
      Execution::kWorker,
      [&dispatcher](ServerCall& /*call*/, const v1::GetDescriptorsRequest& /*request*/)
          -> StatusOr<v1::GetDescriptorsResponse> {
        return DescribeServices(dispatcher.services());
      });
}

}  // namespace loci
