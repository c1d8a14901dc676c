// SPDX-License-Identifier: Apache-2.0
#include "core/base/archive.h"

namespace loci {

void BinaryReader::Raw(void* data, std::size_t size_bytes) {
  if (size_bytes == 0) {
    return;
  }
  if (failed_ || rest_.size() < size_bytes) {
    failed_ = true;
    std::memset(data, 0, size_bytes);
    return;
  }
  std::memcpy(data, rest_.data(), size_bytes);
  rest_.remove_prefix(size_bytes);
}

std::size_t BinaryReader::ReadCount(std::size_t element_size_bytes) {
  std::uint64_t count = 0;
  Raw(&count, sizeof(count));
  // No element is smaller than its bytes, so a count beyond what is left is damage, not data.
  if (failed_ || count > rest_.size() / element_size_bytes) {
    failed_ = true;
    return 0;
  }
  return static_cast<std::size_t>(count);
}

Status BinaryReader::Finish(std::string_view what) const {
  if (failed_) {
    return DataLossError(std::string(what) + ": bytes are missing or a length is impossible");
  }
  if (!rest_.empty()) {
    return DataLossError(std::string(what) + ": " + std::to_string(rest_.size()) +
                         " bytes are left over");
  }
  return {};
}

}  // namespace loci
