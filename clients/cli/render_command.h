// SPDX-License-Identifier: Apache-2.0
// `loci render`: a picture of a map.
#pragma once

#include "clients/cli/command.h"

namespace loci::cli {

Command MakeRenderCommand();

}  // namespace loci::cli
