// SPDX-License-Identifier: Apache-2.0
// The server describes its services, so that a client needs no generated code.
#pragma once

#include <vector>

#include <google/protobuf/descriptor.h>

#include "loci/v1/reflection.pb.h"
#include "server/rpc/dispatcher.h"

namespace loci {

// The services' names, and their files with all that they import, each after its imports.
v1::GetDescriptorsResponse DescribeServices(
    const std::vector<const google::protobuf::ServiceDescriptor*>& services);

// Serves loci.v1.Reflection for the services that `dispatcher` has when it is asked.
void RegisterReflection(Dispatcher& dispatcher);

}  // namespace loci
