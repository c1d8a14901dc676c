// SPDX-License-Identifier: Apache-2.0
// Lines of a text file that may be compressed.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/status.h"

namespace loci {

// Where the bytes of a file come from: plain, gzip or bzip2, decided by the first bytes.
class ByteSource {
 public:
  virtual ~ByteSource() = default;
  // Fills `buffer` with up to `size_bytes` bytes and returns how many; 0 at the end of the file.
  // kDataLoss if the compressed stream is damaged or ends too early; kUnknown if reading fails.
  virtual StatusOr<std::size_t> Read(char* buffer, std::size_t size_bytes) = 0;
};

// kNotFound or kPermissionDenied if the file cannot be opened, with its path.
StatusOr<std::unique_ptr<ByteSource>> OpenByteSource(const std::string& path);

// Reads a file line by line. One thread at a time.
class LineSource {
 public:
  // Longer lines are an error: a scan of 4096 beams needs less than 64 KiB.
  static constexpr std::size_t kLineBytesMax = std::size_t{1} << 20U;

  struct Line {
    std::string_view text;   // without "\n" and "\r"; valid until the next call of Next
    std::size_t number = 0;  // from 1
    bool ended = true;       // false: the file stops inside this line
  };

  explicit LineSource(std::unique_ptr<ByteSource> bytes);

  // The next line; nothing at the end of the file. Lines that are too long come back cut to
  // kLineBytesMax with `ended` false; reading goes on with the line after it.
  // Errors: those of ByteSource::Read, and for ever after the first one. Lines before the damage
  // have been returned before.
  StatusOr<std::optional<Line>> Next();

  // Of the line that Next returned last, or that it failed in.
  std::size_t line_number() const { return line_number_; }

 private:
  std::optional<Line> TakeLine();
  Status Fill();

  std::unique_ptr<ByteSource> bytes_;
  std::string buffer_;
  std::size_t begin_ = 0;    // of what is not returned yet in buffer_
  std::size_t scanned_ = 0;  // no newline in [begin_, scanned_)
  std::size_t line_number_ = 0;
  bool skipping_ = false;  // inside the rest of a line that was too long
  bool at_end_ = false;
  Status status_;
};

}  // namespace loci
