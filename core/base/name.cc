// SPDX-License-Identifier: Apache-2.0
#include "core/base/name.h"

#include <string>

namespace loci {

Status ValidateName(std::string_view name, std::string_view field) {
  bool valid = !name.empty() && name.size() <= kNameSizeMax;
  for (const char c : name) {
    valid = valid && ((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '-');
  }
  if (valid) {
    return {};
  }
  // The name may hold anything: what is shown is short and printable.
  std::string shown(name.substr(0, kNameSizeMax));
  for (char& c : shown) {
    c = c >= ' ' && c <= '~' ? c : '?';
  }
  return InvalidArgumentError(std::string(field) + ": \"" + shown + "\" (" +
                              std::to_string(name.size()) + " bytes), must match [a-z0-9_-]{1,64}");
}

}  // namespace loci
